//! Effects that depend on time itself.

use super::{EffectKind, EffectRow, ROW, Scan, ScanBy};

const BASE: EffectRow = EffectRow { kind: EffectKind::TimeDependent, ..ROW };

const FREQUENCY: &[Scan] = &[Scan { name: "frequency", by: ScanBy::Frequency, example: 2.0 }];

pub(super) static ROWS: &[EffectRow] = &[
    EffectRow {
        name: "harmonic_drive",
        aliases: &["periodic_force"],
        template: "force {q} += span{ {n}_cos: cos({frequency}*{t}), {n}_sin: sin({frequency}*{t}) }",
        parameters: FREQUENCY,
        physics: "A force that oscillates with one frequency: an unbalanced motor, a shaken table.",
        telltale: "The residual force is a wave in time, of the same phase whatever the state.",
        reference: "Landau and Lifshitz, Mechanics, section 22",
        ..BASE
    },
    EffectRow {
        name: "second_drive",
        template: "force {q} += span{ {n}_cos: cos({frequency}*{t}), {n}_sin: sin({frequency}*{t}) }",
        parameters: FREQUENCY,
        second_of: Some("harmonic_drive"),
        physics: "A force that oscillates with another frequency beside that of a harmonic_drive: the overtone of a motor, a second machine on the same floor.",
        telltale: "Beside a first wave in time, the residual force is another one; both together beat.",
        reference: "Den Hartog, Mechanical Vibrations, section 1.3",
        ..BASE
    },
    EffectRow {
        name: "parametric_drive",
        template: "force {q} += span{ {n}_cos: -{q}*cos({frequency}*{t}), {n}_sin: -{q}*sin({frequency}*{t}) }",
        parameters: FREQUENCY,
        physics: "A stiffness that oscillates: a swing that is pumped, a pendulum whose pivot is shaken.",
        telltale: "The residual force is a wave in time whose size goes with the excursion; growth near twice the own frequency.",
        reference: "Landau and Lifshitz, Mechanics, section 27",
        ..BASE
    },
    EffectRow {
        name: "stiffness_drift",
        template: "force {q} += span{ {n}: -{t}*{q} }",
        physics: "A stiffness that changes slowly: a spring that warms up or fatigues.",
        telltale: "The frequency creeps in the course of a run, whatever the amplitude.",
        reference: "Landau and Lifshitz, Mechanics, section 49",
        ..BASE
    },
    EffectRow {
        name: "drag_drift",
        template: "force {q} += span{ {n}: -{t}*{p} }",
        physics: "Friction that changes slowly: a bearing that warms up, a fluid that thickens.",
        telltale: "The decay quickens or slackens in the course of a run, whatever the amplitude.",
        reference: "Nayfeh and Mook, Nonlinear Oscillations, section 3.4",
        ..BASE
    },
    EffectRow {
        name: "force_drift",
        template: "force {q} += span{ {n}: {t} }",
        physics: "A steady force that grows in proportion to time: a load that fills, a table that sinks.",
        telltale: "The middle of the oscillation wanders in a straight line.",
        reference: "Meirovitch, Fundamentals of Vibrations, section 4.3",
        ..BASE
    },
    EffectRow {
        name: "step_force",
        template: "force {q} += span{ {n}: (1 + tanh(({t} - {instant})/{duration}))/2 }",
        parameters: &[
            Scan { name: "instant", by: ScanBy::Instant, example: 5.0 },
            Scan { name: "duration", by: ScanBy::Duration, example: 0.1 },
        ],
        physics: "A steady force that sets in at some instant: a load put down, a valve opened.",
        telltale: "The residual force is zero before an instant and constant after it.",
        reference: "Meirovitch, Fundamentals of Vibrations, section 4.2",
        ..BASE
    },
    EffectRow {
        name: "decaying_force",
        template: "force {q} += span{ {n}: exp(-{rate}*{t}) }",
        parameters: &[Scan { name: "rate", by: ScanBy::Rate, example: 0.5 }],
        physics: "A force that dies away after the start: something that settles, cools or discharges.",
        telltale: "The first part of every run is off, the later ones are not.",
        reference: "Meirovitch, Fundamentals of Vibrations, section 4.4",
        ..BASE
    },
];
