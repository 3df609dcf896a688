//! Effects that take energy away, or feed it in.

use super::{ActsOn, EffectKind, EffectRow, ROW, Scan, ScanBy};

const BASE: EffectRow = EffectRow { kind: EffectKind::Dissipative, positive: true, ..ROW };

pub(super) static ROWS: &[EffectRow] = &[
    EffectRow {
        name: "viscous_drag",
        aliases: &["linear_drag", "viscous_friction"],
        template: "force {q} += span{ {n}: -{p} }",
        physics: "A drag in proportion to the speed, as of slow motion through a thick fluid or of eddy currents.",
        telltale: "Amplitudes fall exponentially; the residual force is a straight line against the momentum.",
        reference: "G. G. Stokes, Trans. Cambridge Phil. Soc. 9, 8 (1851); Landau and Lifshitz, Mechanics, section 25",
        ..BASE
    },
    EffectRow {
        name: "quadratic_drag",
        aliases: &["air_drag", "newton_drag"],
        template: "force {q} += span{ {n}: -{p}*abs({p}) }",
        physics: "A drag in proportion to the square of the speed, as of fast motion through air or water.",
        telltale: "Amplitudes fall like 1/t: fast when large, hardly at all when small.",
        reference: "Batchelor, An Introduction to Fluid Dynamics, section 5.11",
        ..BASE
    },
    EffectRow {
        name: "cubic_drag",
        template: "force {q} += span{ {n}: -{p}^3 }",
        physics: "A drag in proportion to the cube of the speed, the first symmetric correction to a linear one.",
        telltale: "Only the fastest parts of the motion are damped; the residual force is a cubic in the momentum.",
        reference: "Nayfeh and Mook, Nonlinear Oscillations, section 3.3",
        ..BASE
    },
    EffectRow {
        name: "power_drag",
        template: "force {q} += span{ {n}: -{p}*(1 + ({p}/{momentum})^2)^(({exponent} - 1)/2) }",
        parameters: &[
            Scan { name: "momentum", by: ScanBy::Momentum, example: 0.5 },
            Scan { name: "exponent", by: ScanBy::Exponent, example: 1.5 },
        ],
        physics: "A drag that is linear at small speed and a power of the speed above, as of a shear-thinning fluid or a transitional wake.",
        telltale: "Damping against amplitude is a power that is neither linear nor quadratic.",
        reference: "P. J. Carreau, Trans. Soc. Rheology 16, 99 (1972)",
        ..BASE
    },
    EffectRow {
        name: "coulomb_friction",
        aliases: &["dry_friction"],
        template: "force {q} += span{ {n}: -sign({p}) }",
        physics: "Dry friction: a force of fixed size against the direction of motion.",
        telltale: "Amplitudes fall in a straight line and the motion stops; the residual force jumps where the momentum changes sign.",
        reference: "C. A. Coulomb, Theorie des machines simples (1785); Den Hartog, Mechanical Vibrations, chapter 8",
        ..BASE
    },
    EffectRow {
        name: "stribeck_friction",
        template: "force {q} += span{ {n}: -sign({p})*exp(-({p}/{momentum})^2) }",
        parameters: &[Scan { name: "momentum", by: ScanBy::Momentum, example: 0.5 }],
        physics: "Friction that falls as sliding begins, where a lubricant film builds up.",
        telltale: "The residual force jumps at zero momentum and dies away at larger ones; slow motion sticks and slips.",
        reference: "Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30, 1083 (1994)",
        ..BASE
    },
    EffectRow {
        name: "asymmetric_friction",
        aliases: &["directional_friction"],
        template: "force {q} += span{ {n}_forward: -(1 + sign({p}))/2, {n}_backward: (1 - sign({p}))/2 }",
        where_equal: Some("coulomb_friction"),
        physics: "Dry friction that is not the same forward and backward: a ratchet, hair or scales, a tilted bristle.",
        telltale: "The residual force jumps where the momentum changes sign, to sizes that differ.",
        reference: "Bowden and Tabor, The Friction and Lubrication of Solids, chapter 5",
        ..BASE
    },
    EffectRow {
        name: "asymmetric_drag",
        template: "force {q} += span{ {n}_forward: -({p} + abs({p}))/2, {n}_backward: -({p} - abs({p}))/2 }",
        where_equal: Some("viscous_drag"),
        physics: "A drag in proportion to the speed that is not the same forward and backward: a damper with valves, as cars have.",
        telltale: "The residual force against the momentum is two straight lines with a corner at rest.",
        reference: "Dixon, The Shock Absorber Handbook, chapter 3",
        ..BASE
    },
    EffectRow {
        name: "relative_damping",
        one_unit: true,
        on: ActsOn::Pair,
        template: "force {q} += span{ {n}: {s} - {p} }; force {r} += span{ {n}: {p} - {s} }",
        why_two: "it damps the motion of one coordinate against another",
        physics: "A damper between two moving parts of equal inertia: equal and opposite forces against their relative motion.",
        telltale: "Relative motion dies out while common motion goes on.",
        reference: "Rayleigh, The Theory of Sound, section 81",
        ..BASE
    },
    EffectRow {
        name: "self_excitation",
        aliases: &["galloping"],
        template: "force {q} += span{ {n}: {p} }",
        physics: "A force along the motion, in proportion to the speed: wind on an iced cable, a pick-up that feeds back, a friction that falls with speed.",
        telltale: "Amplitudes grow exponentially until something else limits them.",
        reference: "J. P. Den Hartog, Mechanical Vibrations, chapter 7",
        ..BASE
    },
    EffectRow {
        name: "negative_damping",
        aliases: &["van_der_pol"],
        template: "force {q} += span{ {n}_gain: {p}, {n}_loss: -{q}^2*{p} }",
        physics: "Energy is fed in at small excursions and taken out at large ones, so that the motion sustains itself.",
        telltale: "Small oscillations grow and large ones shrink to one and the same cycle.",
        reference: "B. van der Pol, Phil. Mag. 2, 978 (1926)",
        ..BASE
    },
];
