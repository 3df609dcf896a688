//! Effects that are parts of the potential.

use super::{ActsOn, EffectKind, EffectRow, ROW, Scan, ScanBy};

const BASE: EffectRow = EffectRow { kind: EffectKind::Conservative, ..ROW };

const BETWEEN: &str = "it couples one coordinate to another";
const CENTRE: &str = "its distance from a centre is that of a plane or of space";

pub(super) static ROWS: &[EffectRow] = &[
    EffectRow {
        name: "constant_force",
        aliases: &["uniform_force"],
        template: "V += span{ {n}: -{q} }",
        physics: "A force that is the same everywhere: a tilted bench, gravity along a rail, a static load.",
        telltale: "The middle of the oscillation is off zero; the residual force is constant.",
        reference: "Landau and Lifshitz, Mechanics, section 5",
        ..BASE
    },
    EffectRow {
        name: "tilt",
        aliases: &["tilted_zero"],
        template: "V += span{ {n}: sin({q}) }",
        angle: true,
        physics: "A pendulum whose angle is not counted from the vertical: the zero of the scale is tilted.",
        telltale: "The rest position is off zero; the residual force goes with the cosine of the angle.",
        reference: "Goldstein, Classical Mechanics, section 1.6",
        ..BASE
    },
    EffectRow {
        name: "linear_spring",
        aliases: &["harmonic_spring"],
        template: "V += span{ {n}: {q}^2/2 }",
        physics: "A restoring force in proportion to the excursion.",
        telltale: "All frequencies are off by the same; the residual force is a straight line against the coordinate.",
        reference: "R. Hooke, De potentia restitutiva (1678); Landau and Lifshitz, Mechanics, section 21",
        ..BASE
    },
    EffectRow {
        name: "quadratic_stiffness",
        template: "V += span{ {n}: {q}^3/3 }",
        physics: "A spring that is stiffer on one side than on the other.",
        telltale: "Excursions are larger on one side; even harmonics appear and the mean shifts with amplitude.",
        reference: "Landau and Lifshitz, Mechanics, section 28",
        ..BASE
    },
    EffectRow {
        name: "cubic_stiffness",
        aliases: &["duffing"],
        template: "V += span{ {n}: {q}^4/4 }",
        physics: "A spring that hardens or softens with excursion, the same on both sides.",
        telltale: "The frequency shifts with the square of the amplitude; a third harmonic appears.",
        reference: "G. Duffing, Erzwungene Schwingungen bei veraenderlicher Eigenfrequenz (1918)",
        ..BASE
    },
    EffectRow {
        name: "quintic_stiffness",
        template: "V += span{ {n}: {q}^6/6 }",
        physics: "A spring that hardens or softens only at large excursion.",
        telltale: "The frequency shifts with the fourth power of the amplitude; only the largest swings are off.",
        reference: "Nayfeh and Mook, Nonlinear Oscillations, section 2.1",
        ..BASE
    },
    EffectRow {
        name: "double_well",
        template: "V += span{ {n}_hill: -{q}^2/2, {n}_wall: {q}^4/4 }",
        physics: "Two rest positions with a hill between them, as of a buckled beam.",
        telltale: "The motion stays on one side or jumps between two; the residual force is an odd cubic.",
        reference: "Guckenheimer and Holmes, Nonlinear Oscillations, section 2.2",
        positive: true,
        ..BASE
    },
    EffectRow {
        name: "pendulum",
        aliases: &["gravity_torque"],
        template: "V += span{ {n}: -cos({q}) }",
        angle: true,
        physics: "The torque of gravity, or of a magnetic field, on something that turns.",
        telltale: "The residual force goes with the sine of the angle and repeats every turn.",
        reference: "Landau and Lifshitz, Mechanics, section 11",
        ..BASE
    },
    EffectRow {
        name: "periodic_substrate",
        aliases: &["cogging"],
        template: "V += span{ {n}_cos: cos({wave}*{q}), {n}_sin: sin({wave}*{q}) }",
        parameters: &[Scan { name: "wave", by: ScanBy::WaveNumber, example: 2.5 }],
        physics: "A potential that repeats itself along the coordinate: the teeth of a motor, a crystal surface.",
        telltale: "The residual force is a wave against the coordinate.",
        reference: "Frenkel and Kontorova, Zh. Eksp. Teor. Fiz. 8, 1340 (1938)",
        ..BASE
    },
    EffectRow {
        name: "coupling_spring",
        one_unit: true,
        on: ActsOn::Pair,
        template: "V += span{ {n}: ({r} - {q})^2/2 }",
        why_two: BETWEEN,
        physics: "A linear spring between two coordinates.",
        telltale: "Energy beats to and fro between them; the residual force goes with their difference.",
        reference: "Landau and Lifshitz, Mechanics, section 23",
        ..BASE
    },
    EffectRow {
        name: "quadratic_coupling",
        one_unit: true,
        on: ActsOn::Pair,
        template: "V += span{ {n}: ({r} - {q})^3/3 }",
        why_two: BETWEEN,
        physics: "A spring between two coordinates that is stiffer in stretch than in compression.",
        telltale: "The residual force goes with the square of their difference, opposite on the two.",
        reference: "Fermi, Pasta, Ulam and Tsingou, Los Alamos report LA-1940 (1955), alpha model",
        ..BASE
    },
    EffectRow {
        name: "cubic_coupling",
        one_unit: true,
        on: ActsOn::Pair,
        template: "V += span{ {n}: ({r} - {q})^4/4 }",
        why_two: BETWEEN,
        physics: "A spring between two coordinates that hardens or softens with their distance.",
        telltale: "Beats quicken with amplitude; the residual force goes with the cube of the difference.",
        reference: "Fermi, Pasta, Ulam and Tsingou, Los Alamos report LA-1940 (1955), beta model",
        ..BASE
    },
    EffectRow {
        name: "bilinear_coupling",
        on: ActsOn::Pair,
        template: "V += span{ {n}: {q}*{r} }",
        why_two: BETWEEN,
        physics: "Each coordinate pushes the other in proportion to its own excursion: skewed principal axes.",
        telltale: "The residual force on one goes with the other coordinate.",
        reference: "Goldstein, Classical Mechanics, section 6.2",
        ..BASE
    },
    EffectRow {
        name: "quadratic_cross_coupling",
        on: ActsOn::OrderedPair,
        template: "V += span{ {n}: {q}^2*{r} }",
        why_two: BETWEEN,
        physics: "The stiffness of the first coordinate goes with the second, as of a swinging spring.",
        telltale: "Energy flows where the second frequency is twice the first; the residual force on the second goes with the square of the first.",
        reference: "Henon and Heiles, Astron. J. 69, 73 (1964)",
        ..BASE
    },
    EffectRow {
        name: "cubic_cross_coupling",
        on: ActsOn::OrderedPair,
        template: "V += span{ {n}: {q}^3*{r} }",
        why_two: BETWEEN,
        physics: "The second coordinate is pushed by the cube of the first: modes of a beam or a string with an internal resonance of one to three.",
        telltale: "Energy flows where the second frequency is three times the first; the residual force on the second goes with the cube of the first.",
        reference: "Nayfeh and Mook, Nonlinear Oscillations, section 6.6",
        ..BASE
    },
    EffectRow {
        name: "quartic_cross_coupling",
        on: ActsOn::Pair,
        template: "V += span{ {n}: {q}^2*{r}^2/2 }",
        why_two: BETWEEN,
        physics: "The stiffness of each coordinate goes with the square of the other: two modes that stretch one string.",
        telltale: "The frequency of one shifts with the amplitude of the other; nothing is felt while one is at rest at zero.",
        reference: "Nayfeh and Mook, Nonlinear Oscillations, section 6.2",
        ..BASE
    },
    EffectRow {
        name: "central_inverse",
        aliases: &["kepler", "coulomb_potential"],
        on: ActsOn::Body,
        template: "V += span{ {n}: -1/sqrt({qq}) }",
        why_two: CENTRE,
        physics: "Gravity or an electric charge at the origin: a force like 1/r^2.",
        telltale: "The residual force points to the origin and is largest near to it.",
        reference: "Landau and Lifshitz, Mechanics, section 15",
        ..BASE
    },
    EffectRow {
        name: "central_inverse_square",
        on: ActsOn::Body,
        template: "V += span{ {n}: -1/{qq} }",
        why_two: CENTRE,
        physics: "A potential like 1/r^2 about the origin, as of a dipole; it turns the apsides of an orbit.",
        telltale: "Orbits precess at a steady rate; the residual force falls like 1/r^3.",
        reference: "I. Newton, Principia, book I, proposition 44; Landau and Lifshitz, Mechanics, section 15",
        ..BASE
    },
    EffectRow {
        name: "softened_centre",
        aliases: &["plummer"],
        on: ActsOn::Body,
        template: "V += span{ {n}: -1/sqrt({qq} + {length}^2) }",
        parameters: &[Scan { name: "length", by: ScanBy::Length, example: 0.5 }],
        why_two: CENTRE,
        physics: "An attracting body of some extent at the origin: linear inside, like 1/r^2 outside.",
        telltale: "The residual force points to the origin, is largest at some distance and vanishes at the centre.",
        reference: "H. C. Plummer, Mon. Not. R. Astron. Soc. 71, 460 (1911)",
        ..BASE
    },
    EffectRow {
        name: "tidal_force",
        one_unit: true,
        aliases: &["gravity_gradient"],
        on: ActsOn::OrderedPair,
        template: "V += span{ {n}: -(2*{q}^2 - {r}^2)/2 }",
        why_two: "it stretches along one direction and squeezes across it",
        physics: "The tide of a distant body that lies along the first coordinate: a stretch along it, half as much of a squeeze across.",
        telltale: "The residual force points outward along one axis and inward along the other, in proportion to the distance.",
        reference: "G. W. Hill, Am. J. Math. 1, 5 (1878)",
        ..BASE
    },
    EffectRow {
        name: "contact_above",
        template: "V += span{ {n}: ((abs({q} - {position}) + {q} - {position})/2)^2/2 }",
        parameters: &[Scan { name: "position", by: ScanBy::Position, example: 0.5 }],
        physics: "A stop that is touched only above some position, and pushes back like a spring.",
        telltale: "The residual force is zero up to a point, and a straight line beyond.",
        reference: "Shaw and Holmes, J. Sound Vib. 90, 129 (1983)",
        positive: true,
        ..BASE
    },
    EffectRow {
        name: "contact_below",
        template: "V += span{ {n}: ((abs({position} - {q}) + {position} - {q})/2)^2/2 }",
        parameters: &[Scan { name: "position", by: ScanBy::Position, example: -0.5 }],
        physics: "A stop that is touched only below some position, and pushes back like a spring.",
        telltale: "The residual force is zero down to a point, and a straight line beyond.",
        reference: "Shaw and Holmes, J. Sound Vib. 90, 129 (1983)",
        positive: true,
        ..BASE
    },
    EffectRow {
        name: "hertz_contact_above",
        aliases: &["hertz_contact"],
        template: "V += span{ {n}: 2*((abs({q} - {position}) + {q} - {position})/2)^(5/2)/5 }",
        parameters: &[Scan { name: "position", by: ScanBy::Position, example: 0.5 }],
        physics: "A round body that is pressed above some position: its contact grows, and with it the stiffness.",
        telltale: "The residual force is zero up to a point, and beyond it grows as the overlap to the power of 3/2.",
        reference: "H. Hertz, J. reine angew. Math. 92, 156 (1882); Landau and Lifshitz, Theory of Elasticity, section 9",
        positive: true,
        ..BASE
    },
    EffectRow {
        name: "hertz_contact_below",
        template: "V += span{ {n}: 2*((abs({position} - {q}) + {position} - {q})/2)^(5/2)/5 }",
        parameters: &[Scan { name: "position", by: ScanBy::Position, example: -0.5 }],
        physics: "A round body that is pressed below some position: its contact grows, and with it the stiffness.",
        telltale: "The residual force is zero down to a point, and beyond it grows as the overlap to the power of 3/2.",
        reference: "H. Hertz, J. reine angew. Math. 92, 156 (1882); Landau and Lifshitz, Theory of Elasticity, section 9",
        positive: true,
        ..BASE
    },
    EffectRow {
        name: "play",
        aliases: &["backlash", "dead_zone"],
        template: "V += span{ {n}: ((abs(abs({q}) - {length}) + abs({q}) - {length})/2)^2/2 }",
        parameters: &[Scan { name: "length", by: ScanBy::Length, example: 0.4 }],
        physics: "A spring with play: it is felt only beyond the same distance to either side, as of worn gears or a loose joint.",
        telltale: "The residual force is zero about the middle, and a straight line beyond on both sides.",
        reference: "Shaw and Holmes, J. Sound Vib. 90, 129 (1983)",
        positive: true,
        ..BASE
    },
    EffectRow {
        name: "magnet_below",
        aliases: &["magnet"],
        template: "V += span{ {n}: ({q}^2 - 2*{length}^2)/({q}^2 + {length}^2)^(5/2) }",
        parameters: &[Scan { name: "length", by: ScanBy::Length, example: 0.6 }],
        physics: "A magnet on the path passes over another at zero, at the distance of a length: two dipoles that point along the line across the path.",
        telltale: "The residual force pulls to zero when near, and pushes away beyond twice the length.",
        reference: "Jackson, Classical Electrodynamics, section 5.7",
        ..BASE
    },
    EffectRow {
        name: "image_charge",
        aliases: &["electrostatic_wall"],
        template: "V += span{ {n}: -1/(4*abs({q} - {position})) }",
        parameters: &[Scan { name: "position", by: ScanBy::Beyond, example: 2.2 }],
        physics: "A charge before a conducting wall across the path: its image pulls it in, as the electrode of a micromechanical device does.",
        telltale: "The residual force points to one side, and grows with the inverse square of the distance to a wall that is never reached.",
        reference: "Jackson, Classical Electrodynamics, section 2.1",
        positive: true,
        ..BASE
    },
];
