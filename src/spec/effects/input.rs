//! Effects between a measured input and the force that it stands for.

use super::{ActsOn, EffectKind, EffectRow, ROW, Scan, ScanBy};

const BASE: EffectRow = EffectRow { kind: EffectKind::TimeDependent, on: ActsOn::Driven, ..ROW };

pub(super) static ROWS: &[EffectRow] = &[
    EffectRow {
        name: "input_gain",
        aliases: &["actuator_gain"],
        template: "force {q} += span{ {n}: {input} }",
        physics: "A drive that gives more or less than its command says: a force constant, a gear ratio, an amplifier. The coefficient is what is added to the gain.",
        telltale: "The residual force is the input itself, times one number.",
        reference: "Ljung, System Identification: Theory for the User, section 4.2",
        ..BASE
    },
    EffectRow {
        name: "input_asymmetry",
        aliases: &["actuator_asymmetry"],
        template: "force {q} += span{ {n}: abs({input}) }",
        physics: "A drive that pushes harder one way than the other: two amplifiers, a cylinder with a rod on one side.",
        telltale: "The residual force is the size of the input, of one sign whatever that of the input.",
        reference: "Merritt, Hydraulic Control Systems, section 6.2",
        ..BASE
    },
    EffectRow {
        name: "input_dead_zone",
        aliases: &["actuator_dead_zone", "dead_band"],
        template: "force {q} += span{ {n}: (abs({input} - {width}) - abs({input} + {width}))/2 }",
        whole: true,
        parameters: &[Scan { name: "width", by: ScanBy::Level, example: 0.1 }],
        physics: "A drive that small commands do not move: an overlapped valve, friction inside it. The coefficient is the gain of the command, where the spec says that.",
        telltale: "The residual force goes against the input, and grows with it no further than a certain size.",
        reference: "Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, chapter 2",
        ..BASE
    },
    EffectRow {
        name: "input_saturation",
        aliases: &["actuator_saturation"],
        template: "force {q} += span{ {n}: (abs({input} + {limit}) - abs({input} - {limit}))/2 - {input} }",
        whole: true,
        parameters: &[Scan { name: "limit", by: ScanBy::Level, example: 0.8 }],
        physics: "A drive that gives no more than a certain force: the limit of a current or a pressure. The coefficient is the gain of the command, where the spec says that.",
        telltale: "The residual force is zero while the input is small, and goes against it where it is large.",
        reference: "Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, chapter 2",
        ..BASE
    },
    EffectRow {
        name: "input_delay",
        aliases: &["actuator_delay", "dead_time"],
        template: "force {q} += span{ {n}: delayed({input}, {delay}) - {input} }",
        whole: true,
        parameters: &[Scan { name: "delay", by: ScanBy::Delay, example: 0.05 }],
        physics: "A force that follows its command some time later: a bus, a computation, a pipe. The coefficient is the gain of the command, where the spec says that.",
        telltale: "The response is late by the same time whatever the frequency, and of the right size.",
        reference: "Franklin, Powell and Emami-Naeini, Feedback Control of Dynamic Systems, section 5.6",
        ..BASE
    },
];
