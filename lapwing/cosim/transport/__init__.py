"""Transport: the Zenoh bus, keys, packets and their exchange between participants."""
