"""Small studies of machines, for tests."""

import tomllib
from importlib import resources

from arms import serial_arm

from hdmm_opt.study import load, validated

#: Enough for a proof and a few runs.
QUICK = {"method": "jaya", "population": 4, "iterations": 0, "seed": 1}


def bundled(name):
    """A bundled study as data."""
    return tomllib.loads((resources.files("hdmm_opt") / "studies" / f"{name}.toml").read_text(encoding="utf-8"))


def emla(name):
    """A bundled study of one actuator as data, without values that are none."""
    return load(name).model_dump(mode="json", exclude_none=True)


def proportional():
    """emla-p2 at once and without a load network: eight searched gains, a load of any course, larger initial errors."""
    data = emla("emla-p2")
    data["controller"]["delay_s"] = 0.0
    data["controller"]["gains"] = {
        **{f"beta_{k}": {"min": low, "max": high} for k, low, high in ((1, 8.0, 60.0), (2, 1500.0, 15000.0))},
        **{f"epsilon_{k}": {"min": 1.0, "max": high} for k, high in ((1, 1000.0), (2, 1500.0))},
        **{f"delta_{k}": {"min": 0.1, "max": 10.0} for k in (1, 2)},
        **{f"sigma_{k}": {"min": 1.0, "max": 50.0} for k in (1, 2)},
    }
    data["uncertainty"]["disturbances"]["load_force"].pop("rate")
    data["requirements"].pop("settling_band_m")
    data["uncertainty"]["initial"] = {"position_m": 1e-4, "speed_m_s": 3e-3, "torque_nm": 12.0}
    data["tuning"] |= {"population": 20, "iterations": 20, "weights": {}}
    return data


def quick_arm(**changes):
    """The study arm-p3, short: one move there and back, faults after 3 s, no search."""
    data = bundled("arm-p3")
    data["reference"] |= {"waypoints": data["reference"]["waypoints"][:3], "durations_s": [4.0, 4.0], "dwell_s": 0.2}
    data["tuning"] = dict(QUICK)
    data["validation"] |= {"transient_s": 0.5, "monte_carlo": 4}
    for scenario in data["validation"]["scenarios"]:
        for fault in scenario.get("faults", {}).values():
            fault["start_s"] = 4.5
    data["study"]["name"] = "quick-arm"
    for key, value in changes.items():
        place, *rest = key.split("__")
        section = data[place]
        for part in rest[:-1]:
            section = section[part]
        section[rest[-1]] = value
    return data


def serial_study(joints, tmp_path, armature=40.0):
    """A serial arm of any number of joints, with actuators whose inertia dominates."""
    path = tmp_path / f"arm{joints}.urdf"
    path.write_text(serial_arm(joints), encoding="utf-8")
    names = [f"j{k + 1}" for k in range(joints)]
    section = {
        name: {
            "parameters": {
                "armature": {"value": armature * 0.75**k, "unit": "kg m^2", "tolerance": 0.05, "source": "assumed"}
            },
            "limits": {
                "torque": {"value": 1500.0 * 0.85**k, "unit": "N m", "source": "assumed"},
                "speed": {"value": 2.0, "unit": "rad/s", "source": "assumed"},
            },
            "least_effectiveness": 0.8,
        }
        for k, name in enumerate(names)
    }  # fmt: skip
    start = [0.1, 0.4, -0.2, 0.5, 0.1, -0.3, 0.2][:joints]
    goal = [v + 0.25 for v in start]
    return {
        "study": {"name": f"serial-{joints}"},
        "plant": {"model": "arm", "urdf": str(path), "tip_m": [0.1, 0.05, 0.2], "damping": 1.0, "joints": section},
        "uncertainty": {"disturbances": {"payload": {"range": [0.0, 0.5]}}, "noise": {"position": 1e-6, "speed": 1e-4}},
        "reference": {"kind": "quintic", "waypoints": [start, goal], "durations_s": [1.5], "dwell_s": 0.1},
        "controller": {"law": "rac", "rate_hz": 1000, "gains": {
            "beta_1": {"min": 5.0, "max": 100.0}, "epsilon_1": {"min": 1.0, "max": 100.0},
            "beta_2": {"min": 10.0, "max": 1e5}, "epsilon_2": {"min": 1.0, "max": 100.0},
        }},
        "requirements": {"tracking_error_m": 0.2, "member_error": dict.fromkeys(names, 0.2)},
        "tuning": dict(QUICK),
        "validation": {"transient_s": 0.5, "monte_carlo": 4, "scenarios": [{"name": "healthy", "noise": 1.0}]},
    }  # fmt: skip


def study_from(data):
    """The validated study."""
    return validated(data, "test")
