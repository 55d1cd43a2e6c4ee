//! Scenes by name: `wall` or `room`, then any effects, joined by hyphens (`room-slip-8x`).

use anyhow::{bail, ensure};
use wall_scenes::SceneSpec;

/// An effect by name, with the sentence of `--help`.
struct Effect {
    name: &'static str,
    help: &'static str,
    set: fn(&mut SceneSpec),
}

const EFFECTS: &[Effect] = &[
    Effect {
        name: "slip",
        help: "slips outwards in curves (0.2 s times the turn rate) and at random (3 % of a frame)",
        set: |spec| {
            spec.carrier.curve_slip_s = 0.2;
            spec.carrier.slip_ratio = 0.03;
        },
    },
    Effect {
        name: "sway",
        help: "rolls and pitches, 10 mrad root mean square each",
        set: |spec| {
            spec.carrier.roll_rad = 0.01;
            spec.carrier.pitch_rad = 0.01;
        },
    },
    Effect {
        name: "offset",
        help: "has its body origin 0.3 m ahead of its turning centre",
        set: |spec| spec.carrier.origin_ahead_m = 0.3,
    },
    Effect {
        name: "gyro",
        help: "reports 0.01 rad/s too much turn",
        set: |spec| spec.carrier.turn_bias_radps = 0.01,
    },
    Effect {
        name: "wheel",
        help: "reports 2 % too much speed",
        set: |spec| spec.carrier.wheel_radius_ratio = 0.02,
    },
    Effect {
        name: "slope",
        help: "climbs a slope of up to 50 mrad and comes down again",
        set: |spec| spec.carrier.slope_rad = 0.05,
    },
    Effect {
        name: "yaw",
        help: "has a mount that is stated 5 mrad wrong",
        set: |spec| spec.calibration.mount_yaw_rad = 0.005,
    },
    Effect {
        name: "focal",
        help: "has a focal length that is stated 0.5 % wrong",
        set: |spec| spec.calibration.focal_ratio = 0.005,
    },
    Effect {
        name: "slow",
        help: "takes 1500 frames of half a second",
        set: |spec| spec.frames = 1500,
    },
    Effect {
        name: "2x",
        help: "takes twice as many images of the same drive",
        set: |spec| spec.frame_rate.multiple = 2,
    },
    Effect {
        name: "4x",
        help: "takes four times as many",
        set: |spec| spec.frame_rate.multiple = 4,
    },
    Effect {
        name: "8x",
        help: "takes eight times as many",
        set: |spec| spec.frame_rate.multiple = 8,
    },
    Effect {
        name: "half",
        help: "keeps every second image of the same drive",
        set: |spec| spec.frame_rate.divisor = 2,
    },
    Effect {
        name: "quarter",
        help: "keeps every fourth",
        set: |spec| spec.frame_rate.divisor = 4,
    },
    Effect {
        name: "eighth",
        help: "keeps every eighth",
        set: |spec| spec.frame_rate.divisor = 8,
    },
];

/// The effects and their meaning, a line each.
#[must_use]
pub fn effects_help() -> String {
    let mut text = String::from(
        "scenes are wall or room, with any of these behind them, joined by hyphens (room-slip-8x):\n  \
         lapsN    drives N rounds of the room, at the same speed\n",
    );
    for effect in EFFECTS {
        text += &format!("  {:<8} {}\n", effect.name, effect.help);
    }
    text
}

/// The scene of a name with a seed.
///
/// # Errors
/// A name with an unknown part.
pub(crate) fn scene(name: &str, seed: u64) -> anyhow::Result<SceneSpec> {
    let mut parts = name.split('-');
    let mut spec = match parts.next() {
        Some("wall") => SceneSpec::wall(seed),
        Some("room") => SceneSpec::room(seed),
        _ => bail!("no scene `{name}`: it begins with wall or room"),
    };
    for part in parts {
        if let Some(laps) = part.strip_prefix("laps").and_then(|n| n.parse().ok()) {
            ensure!(
                name.starts_with("room"),
                "scene `{name}`: only a room has laps"
            );
            spec.laps = laps;
            spec.frames = SceneSpec::laps(seed, laps).frames;
            continue;
        }
        match EFFECTS.iter().find(|effect| effect.name == part) {
            Some(effect) => (effect.set)(&mut spec),
            None => bail!("scene `{name}`: no effect `{part}`"),
        }
    }
    Ok(spec)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effects_add_up_and_every_one_of_them_is_possible() {
        assert_eq!(scene("wall", 3).unwrap(), SceneSpec::wall(3));
        let spec = scene("room-laps2-offset-8x", 4).unwrap();
        assert_eq!((spec.laps, spec.frames), (2, 357));
        assert_eq!(spec.carrier.origin_ahead_m, 0.3);
        assert_eq!(spec.frame_rate.multiple, 8);
        for effect in EFFECTS {
            let spec = scene(&format!("room-{}", effect.name), 1).unwrap();
            assert_ne!(spec, SceneSpec::room(1), "{}", effect.name);
            spec.check().unwrap();
            assert!(effects_help().contains(effect.help));
        }
        for (wrong, word) in [
            ("cave", "cave"),
            ("wall-wet", "wet"),
            ("wall-laps2", "laps"),
        ] {
            let message = scene(wrong, 1).unwrap_err().to_string();
            assert!(message.contains(word), "{message}");
        }
    }
}
