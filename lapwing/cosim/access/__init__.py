"""Access control: certificates, Zenoh rules, publisher identity, private sockets."""
