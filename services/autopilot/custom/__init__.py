"""User-defined controllers and estimators; see `controller_api` and `estimator_api` in `lapwing.services.common`."""
