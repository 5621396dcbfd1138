"""Text of scenes with several vehicles."""


def head(duration, *effects, run="", **tables):
    """Return the tables that all vehicles share: run, effects, tuned gains, the true state as estimate.

    `duration` [s]; `effects`: names besides gravity, rotors and ground; `run`, `tables`: further keys, of an effect.
    """
    named = ("gravity", "rotor_thrust", "ground_contact", *effects)
    keys = "".join(f"[effects.{name}]\n{text}\n" for name, text in [*dict.fromkeys(named, "").items(), *tables.items()])
    return f'[run]\nduration = {duration}\n{run}\n{keys}[autopilot]\ngains = "tuned"\nestimator = "ground_truth"\n'


def phase(name, duration, table="vehicle.trajectory", **targets):
    """Return a phase that moves the axes to their targets with minimum jerk, or waits, in `duration` [s]."""
    moves = [f'{k} = {{ kind = "minimum_jerk", to = {v}, duration = {duration} }}' for k, v in targets.items()]
    return f'[[{table}.phase]]\nname = "{name}"\n' + "\n".join(moves or [f"duration = {duration}"]) + "\n"


def vehicle(name, *parts, start=(0.0, 0.0), airframe="delivery_drone"):
    """Return the entry of a vehicle; `parts`: lines of further keys, tables and phases."""
    keys = f'name = "{name}"\nairframe = "{airframe}"\ninitial_position = {list(start)}\n'
    return f"[[vehicle]]\n{keys}" + "\n".join(parts) + "\n"
