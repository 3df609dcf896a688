//! Effects with states of their own, which nobody measures: memories, lags, a part that swings.

use super::{ActsOn, EffectKind, EffectRow, ROW, Scan, ScanBy};

pub(super) static ROWS: &[EffectRow] = &[
    EffectRow {
        name: "bouc_wen",
        aliases: &["hysteresis"],
        kind: EffectKind::Dissipative,
        template: "state {n}_memory { {n}_memory' = rate({q}) - {loss}*(abs(rate({q}))*{n}_memory + {asymmetry}*rate({q})*abs({n}_memory)) }; force {q} += span{ {n}: -{n}_memory }",
        parameters: &[
            Scan { name: "loss", by: ScanBy::WaveNumber, example: 1.0 },
            Scan { name: "asymmetry", by: ScanBy::Ratio, example: 0.5 },
        ],
        physics: "A spring with a memory: its force follows the path on loops, as that of a joint that slips or a metal that yields.",
        telltale: "Force against coordinate is a loop whose area does not depend on the speed.",
        reference: "Wen, J. Eng. Mech. Div. ASCE 102, 249 (1976); Noel and Schoukens, Workshop on Nonlinear System Identification Benchmarks (2016)",
        positive: true,
        ..ROW
    },
    EffectRow {
        name: "lugre",
        aliases: &["bristle_friction"],
        kind: EffectKind::Dissipative,
        template: "state {n}_bristle { {n}_bristle' = rate({q}) - abs(rate({q}))*{n}_bristle/({length}*(1 + {excess}*exp(-({p}/{momentum})^2))) }; force {q} += span{ {n}: -{n}_bristle }",
        parameters: &[
            Scan { name: "length", by: ScanBy::Length, example: 0.1 },
            Scan { name: "excess", by: ScanBy::Ratio, example: 0.5 },
            Scan { name: "momentum", by: ScanBy::Momentum, example: 0.5 },
        ],
        physics: "Friction by bristles that bend before they slip, and slip at a force that falls as sliding begins.",
        telltale: "Where the motion turns, the friction turns over a short way and not at once; slow motion sticks and slips.",
        reference: "Canudas de Wit, Olsson, Astrom and Lischinsky, IEEE Trans. Autom. Control 40, 419 (1995)",
        positive: true,
        ..ROW
    },
    EffectRow {
        name: "hidden_oscillator",
        aliases: &["unseen_oscillator"],
        kind: EffectKind::Conservative,
        template: "state {n}_place { {n}_place' = {n}_speed }; state {n}_speed { {n}_speed' = {frequency}^2*({q} - {n}_place) }; force {q} += span{ {n}: {frequency}^2*({n}_place - {q}) }",
        parameters: &[Scan { name: "frequency", by: ScanBy::Frequency, example: 2.0 }],
        physics: "A mass on a spring, hung from what is measured, that nobody measures; the coefficient is its mass.",
        telltale: "Energy goes away and comes back; the response to a drive has a notch at the frequency of the hidden part.",
        reference: "Den Hartog, Mechanical Vibrations, section 3.2; Frahm, US patent 989958 (1911)",
        positive: true,
        ..ROW
    },
    EffectRow {
        name: "sensor_lag",
        aliases: &["sensor_pole"],
        kind: EffectKind::Sensor,
        on: ActsOn::Observable,
        template: "state {n}_reading { {n}_reading' = ({o} - {n}_reading)/{duration} }; sensor {o} += span{ {n}: {n}_reading - {o} }",
        parameters: &[Scan { name: "duration", by: ScanBy::Duration, example: 0.1 }],
        physics: "A sensor that follows what it measures through a filter of first order: a thermal mass, a low pass. A coefficient of 1 is all of the reading.",
        telltale: "Fast parts of the motion are smaller in this column, and late.",
        reference: "Doebelin, Measurement Systems, section 3.3",
        ..ROW
    },
    EffectRow {
        name: "first_order_actuator",
        aliases: &["actuator_pole"],
        kind: EffectKind::TimeDependent,
        template: "state {n}_drive { {n}_drive' = ({input} - {n}_drive)/{duration} }; force {q} += span{ {n}: {n}_drive - {input} }",
        parameters: &[Scan { name: "duration", by: ScanBy::Duration, example: 0.1 }],
        physics: "An actuator that follows its command through a pole: an inductance, a valve. A coefficient equal to the gain of the command is all of the force.",
        telltale: "The response to fast parts of the input is too small and late; to slow ones it is right.",
        reference: "Franklin, Powell and Emami-Naeini, Feedback Control of Dynamic Systems, section 2.3",
        ..ROW
    },
    EffectRow {
        name: "unseen_body",
        aliases: &["perturber"],
        kind: EffectKind::Conservative,
        on: ActsOn::BodyPair,
        why_two: "it is told by how it pulls on bodies that attract each other",
        detector: Some(
            "write it into the spec with `hidden` coordinates, as examples/planets does",
        ),
        physics: "A mass on an orbit of its own that nobody sees, and that pulls on all that are seen.",
        telltale: "Bodies run ahead of their predicted places, then behind, where the unseen one is near.",
        reference: "Le Verrier, C. R. Acad. Sci. Paris 23, 428 (1846)",
        ..ROW
    },
];
