//! Effects in the instrument: they move nothing.

use super::{ActsOn, EffectKind, EffectRow, ROW, Scan, ScanBy};

const BASE: EffectRow = EffectRow { kind: EffectKind::Sensor, on: ActsOn::Observable, ..ROW };

const FREQUENCY: &[Scan] = &[Scan { name: "frequency", by: ScanBy::Frequency, example: 5.0 }];

pub(super) static ROWS: &[EffectRow] = &[
    EffectRow {
        name: "sensor_offset",
        aliases: &["offset"],
        template: "sensor {o} += span{ {n}: 1 }",
        physics: "The zero of the instrument is off: what it shows is too large by a constant.",
        telltale: "The error is the same at every sample of the column, and no force explains it.",
        reference: "JCGM 200:2012, International vocabulary of metrology, 4.20",
        ..BASE
    },
    EffectRow {
        name: "sensor_scale",
        aliases: &["scale", "gain_error"],
        template: "sensor {o} += span{ {n}: {o} }",
        physics: "The scale of the instrument is off: what it shows is too large by a factor.",
        telltale: "The error goes with the reading itself; coordinate and momentum disagree by a factor.",
        reference: "JCGM 200:2012, International vocabulary of metrology, 4.12",
        ..BASE
    },
    EffectRow {
        name: "sensor_drift",
        aliases: &["drift"],
        template: "sensor {o} += span{ {n}: {t} }",
        physics: "The zero of the instrument wanders in proportion to time, as when it warms up.",
        telltale: "The error grows in a straight line with time, the same in every run.",
        reference: "JCGM 200:2012, International vocabulary of metrology, 4.21",
        ..BASE
    },
    EffectRow {
        name: "sensor_cross_talk",
        aliases: &["cross_talk"],
        on: ActsOn::ObservablePair,
        template: "sensor {o} += span{ {n}: {u} }",
        physics: "A part of the second signal leaks into the first column: axes not square, wires too close.",
        telltale: "The error of one column goes with the reading of another.",
        reference: "Fraden, Handbook of Modern Sensors, chapter 3",
        ..BASE
    },
    EffectRow {
        name: "sensor_nonlinearity",
        aliases: &["nonlinearity"],
        template: "sensor {o} += span{ {n}: {o}^2 }",
        physics: "The instrument's curve is bent: its gain goes with the reading.",
        telltale: "The error is a parabola against the reading.",
        reference: "Fraden, Handbook of Modern Sensors, chapter 3",
        ..BASE
    },
    EffectRow {
        name: "sensor_hum",
        aliases: &["hum"],
        template: "sensor {o} += span{ {n}_cos: cos({frequency}*{t}), {n}_sin: sin({frequency}*{t}) }",
        parameters: FREQUENCY,
        physics: "A wave of one frequency on the signal: mains hum, a vibrating camera.",
        telltale: "The error is a wave in time that does not move the system.",
        reference: "Horowitz and Hill, The Art of Electronics, section 8.13",
        ..BASE
    },
    EffectRow {
        name: "second_hum",
        template: "sensor {o} += span{ {n}_cos: cos({frequency}*{t}), {n}_sin: sin({frequency}*{t}) }",
        parameters: FREQUENCY,
        second_of: Some("sensor_hum"),
        physics: "A wave of another frequency on the signal beside that of a sensor_hum: the overtone of the mains.",
        telltale: "Beside a first wave in time that moves nothing, the error is another one.",
        reference: "Horowitz and Hill, The Art of Electronics, section 8.13",
        ..BASE
    },
    EffectRow {
        name: "clock_shift",
        aliases: &["reading_delay"],
        template: "sensor {o} += span{ {n}: rate({o}) }",
        physics: "The column is read too late or too early: its clock is shifted by a fixed time.",
        telltale: "The error goes with the rate of the reading: largest where it changes fastest.",
        reference: "Ljung, System Identification, section 14.3",
        ..BASE
    },
    EffectRow {
        name: "outliers",
        detector: Some("single samples far off are found in the residuals; fit with a robust loss"),
        physics: "Single readings are wrong by far: a lost frame, a loose contact.",
        telltale: "A few samples are many deviations off, their neighbours are not.",
        reference: "Huber and Ronchetti, Robust Statistics, chapter 1",
        ..BASE
    },
    EffectRow {
        name: "quantisation",
        detector: Some("repeated values are found by the data check; record with more digits"),
        physics: "Readings are rounded to whole steps of the instrument.",
        telltale: "The column holds few different values, at equal distances.",
        reference: "W. R. Bennett, Bell Syst. Tech. J. 27, 446 (1948)",
        ..BASE
    },
];
