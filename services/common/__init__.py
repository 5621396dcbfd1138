"""What several services agree on: tables of a scene, parameters, flight plans."""
