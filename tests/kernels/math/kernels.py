"""Kernels of the elementary functions, by name."""

from lapwing.kernels.math import exponential, inverse_trigonometric, logarithm, roots, trigonometric

KERNELS = {
    name: getattr(module, name)
    for module, names in (
        (trigonometric, "sin cos sincos tan"),
        (inverse_trigonometric, "asin acos atan atan2"),
        (exponential, "exp expm1 tanh"),
        (logarithm, "log log1p pow"),
        (roots, "cbrt hypot"),
    )
    for name in names.split()
}
