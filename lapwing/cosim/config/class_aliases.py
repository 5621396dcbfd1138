"""Present names of the classes in set-ups that were recorded under former names.

A log's `setup.json` names each class as "module:Class". A module or class that is renamed gets a row here, so that logs
recorded before can be read and resimulated. `MODULES` lists the modules that the move below `lapwing` also renamed;
`CLASSES` the renamed classes, by the present name of their module.
"""

FORMER_PACKAGES = ("cosim", "dynamics", "messages", "services", "studies")  # top-level before they moved below lapwing
MODULES = {
    "cosim.schedule": "cosim.diagram.tick_schedule",
    "cosim.setup": "cosim.config.run_config",
    "dynamics.effects.carried_load": "dynamics.effects.shared_slung_load",
    "dynamics.effects.coaxial_wash": "dynamics.effects.coaxial_interference",
    "dynamics.effects.induced_velocity": "dynamics.effects.dynamic_inflow",
    "dynamics.effects.motor_electrics": "dynamics.effects.dc_motor",
    "dynamics.effects.payload": "dynamics.effects.payload_release",
    "dynamics.effects.rotor_inflow": "dynamics.effects.axial_inflow",
    "dynamics.effects.rotor_wash": "dynamics.effects.downwash",
    "dynamics.effects.wind_random": "dynamics.effects.random_wind_force",
    "dynamics.effects._feet": "dynamics.effects._foot_contact",
    "dynamics.effects._interaction": "dynamics.effects._vehicle_interaction",
    "dynamics.integrators._controlled": "dynamics.integrators._step_doubling",
    "dynamics.multibody.arrow": "dynamics.multibody.arrowhead_solver",
    "dynamics.multibody.placement": "dynamics.multibody.body_kinematics",
    "dynamics.terrain.ground": "dynamics.terrain.terrain_queries",
    "dynamics.terrain.surface": "dynamics.terrain.heightfield",
    "dynamics.vehicles.unloading_places": "dynamics.vehicles.unloading_contact_points",
    "services.autopilot.attention": "services.autopilot.commander_wakeup",
    "services.autopilot.commander.attention": "services.autopilot.commander.wakeup_conditions",
    "services.autopilot.core": "services.autopilot.block",
    "services.autopilot.custom.core": "services.autopilot.custom.block",
    "services.autopilot.custom.demand": "services.autopilot.custom.controller_output",
    "services.autopilot.custom.estimator": "services.autopilot.custom.python_estimator",
    "services.autopilot.estimator.parameters": "services.autopilot.estimator.filter_parameters",
    "services.autopilot.estimator.state": "services.autopilot.estimator.filter_state",
    "services.autopilot.law": "services.autopilot.controller_parameters",
    "services.autopilot.reference": "services.autopilot.angle_reference",
    "services.autopilot.setup": "services.autopilot.service_config",
    "services.autopilot.stage": "services.autopilot.land_detector",
    "services.common.controllers": "services.common.controller_api",
    "services.common.failures": "services.common.failure_types",
    "services.common.parameters": "services.common.autopilot_parameters",
    "services.common.vehicle": "services.common.vehicle_schema",
    "services.formation.core": "services.formation.block",
    "services.mavlink.vehicle": "services.mavlink.vehicle_description",
    "services.plant.cores.autonomous": "services.plant.blocks.uncontrolled",
    "services.plant.cores.bodies": "services.plant.blocks.body_states",
    "services.plant.cores.carried_load": "services.plant.blocks.carried_load",
    "services.plant.cores.contact": "services.plant.blocks.contact",
    "services.plant.cores.cooperative_load": "services.plant.blocks.cooperative_load",
    "services.plant.cores.interaction": "services.plant.blocks.interaction",
    "services.plant.cores.multirotor": "services.plant.blocks.multirotor",
    "services.plant.cores.presence": "services.plant.blocks.neighbour_state",
    "services.plant.cores.slung_load": "services.plant.blocks.slung_load",
    "services.plant.cores.unloading_bodies": "services.plant.blocks.unloading_bodies",
    "services.plant.setup": "services.plant.service_config",
    "services.plant.wire": "services.plant.encoders",
    "services.sensors.core": "services.sensors.block",
    "services.sensors.line": "services.sensors.delay_line",
    "services.sensors.wire": "services.sensors.encoders",
    "services.trajectory.core": "services.trajectory.block",
    "services.trajectory.following": "services.trajectory.leader_follower",
    "services.trajectory.piece": "services.trajectory.polynomial_piece",
}
CLASSES = {
    "lapwing.cosim.config.run_config:Each": "PerVehicle",
    "lapwing.cosim.config.run_config:ServiceSetup": "ServiceConfig",
    "lapwing.cosim.config.run_config:Setup": "RunConfig",
    "lapwing.cosim.diagram.tick_schedule:Input": "InputPort",
    "lapwing.dynamics.effects.axial_inflow:RotorInflow": "AxialInflow",
    "lapwing.dynamics.effects.coaxial_interference:CoaxialWash": "CoaxialInterference",
    "lapwing.dynamics.effects.dc_motor:MotorElectrics": "DcMotor",
    "lapwing.dynamics.effects.downwash:RotorWash": "Downwash",
    "lapwing.dynamics.effects.dynamic_inflow:InducedVelocity": "DynamicInflow",
    "lapwing.dynamics.effects.payload_release:Payload": "PayloadRelease",
    "lapwing.dynamics.effects.random_wind_force:WindRandom": "RandomWindForce",
    "lapwing.dynamics.effects.shared_slung_load:CarriedLoad": "SharedSlungLoad",
    "lapwing.dynamics.effects._foot_contact:Footing": "FootContact",
    "lapwing.dynamics.effects._vehicle_interaction:Presence": "NeighbourState",
    "lapwing.dynamics.integrators._step_doubling:Controlled": "StepDoubling",
    "lapwing.dynamics.multibody.arrowhead_solver:Leaf": "HingedBody",
    "lapwing.dynamics.multibody.body_kinematics:Placement": "BodyKinematics",
    "lapwing.dynamics.multibody.system:Drive": "DrivingConstraint",
    "lapwing.services.autopilot.block:Order": "ControllerInput",
    "lapwing.services.autopilot.commander_wakeup:Attention": "WakeupParameters",
    "lapwing.services.autopilot.custom.block:FromPort": "PythonControllerProxy",
    "lapwing.services.autopilot.custom.controller_output:Demand": "ControllerOutput",
    "lapwing.services.autopilot.land_detector:Stage": "LandedState",
    "lapwing.services.autopilot.mixer:Demands": "VirtualControls",
    "lapwing.services.common.ports:BatteryGauge": "BatteryReading",
    "lapwing.services.plant.service_config:Others": "FleetCoupling",
}
FIELDS = {  # renamed fields, by the present name of their class
    "lapwing.dynamics.effects._contact_parameters:GroundContact": {"square_stick_velocity": "square_stiction_velocity"},
    "lapwing.dynamics.effects.battery:Battery": {"charge": "initial_charge", "cut_off": "cutoff_voltage"},
    "lapwing.dynamics.effects.battery_thevenin:BatteryThevenin": {
        "charge": "initial_charge",
        "cut_off": "cutoff_voltage",
    },
    "lapwing.dynamics.effects.rotor_damage:RotorDamage": {"torque_left": "remaining_torque"},
    "lapwing.services.trajectory.service:TrajectorySetup": {"follow": "leader"},
}


def present_name(name: str) -> str:
    """Return the present "module:Class" of a recorded one; unchanged if it was never renamed."""
    module, _, path = name.partition(":")
    if module.partition(".")[0] in FORMER_PACKAGES:
        module = f"lapwing.{MODULES.get(module, module)}"
    return f"{module}:{CLASSES.get(f'{module}:{path}', path)}"
