//! Kinetic effects, and gyroscopic ones.

use super::{ActsOn, EffectKind, EffectRow, ROW};

const KINETIC: EffectRow = EffectRow { kind: EffectKind::Kinetic, ..ROW };
const GYROSCOPIC: EffectRow = EffectRow { kind: EffectKind::Gyroscopic, on: ActsOn::Pair, ..ROW };

const ACROSS: &str =
    "it turns a motion along one direction into the one across, and one dimension has none";

pub(super) static ROWS: &[EffectRow] = &[
    EffectRow {
        name: "position_dependent_mass",
        aliases: &["variable_inertia"],
        template: "H += span{ {n}: {q}^2*{p}^2/2 }",
        physics: "Inertia that changes along the path, as of a bead on a curved wire or a slider crank.",
        telltale: "Velocity over momentum changes with the coordinate; the residual force goes with the square of the momentum.",
        reference: "Goldstein, Classical Mechanics, section 1.6",
        ..KINETIC
    },
    EffectRow {
        name: "coupled_momenta",
        on: ActsOn::Pair,
        template: "T += span{ {n}: {p}*{s} }",
        why_two: "it makes one momentum move the other coordinate",
        physics: "Inertia shared between two coordinates: relative coordinates, added mass, skewed axes.",
        telltale: "A velocity goes with the other coordinate's momentum.",
        reference: "Goldstein, Classical Mechanics, section 6.2",
        ..KINETIC
    },
    EffectRow {
        name: "relativistic_kinetic",
        aliases: &["quartic_kinetic"],
        template: "T += span{ {n}: -{p}^4/8 }",
        physics: "Inertia that grows with speed, to first order in (v/c)^2; also a band that is not parabolic.",
        telltale: "Velocity lags behind momentum at the largest momenta; frequencies fall with energy.",
        reference: "Landau and Lifshitz, The Classical Theory of Fields, section 9",
        positive: true,
        ..KINETIC
    },
    EffectRow {
        name: "inertial_coupling",
        on: ActsOn::Pair,
        template: "H += span{ {n}: -cos({q} - {r})*{p}*{s} }",
        angle: true,
        why_two: "it couples the inertia of two angles",
        physics: "Inertia shared between two angles as far as they point the same way: two links of an arm.",
        telltale: "A velocity goes with the other momentum, with a sign that depends on the angle between the links.",
        reference: "Landau and Lifshitz, Mechanics, section 5, problem 1",
        ..KINETIC
    },
    EffectRow {
        name: "magnetic_force",
        one_unit: true,
        aliases: &["lorentz_force", "coriolis_force"],
        template: "force {q} += span{ {n}: {s} }; force {r} += span{ {n}: -{p} }",
        why_two: ACROSS,
        physics: "A force across the velocity that does no work: a charge in a magnetic field, or the Coriolis force of a turning table.",
        telltale: "Paths curl the same way round everywhere; the plane of a swing turns.",
        reference: "Landau and Lifshitz, The Classical Theory of Fields, section 21; Mechanics, section 39",
        ..GYROSCOPIC
    },
    EffectRow {
        name: "magnetic_gradient",
        one_unit: true,
        on: ActsOn::OrderedPair,
        template: "force {q} += span{ {n}: {q}*{s} }; force {r} += span{ {n}: -{q}*{p} }",
        why_two: ACROSS,
        physics: "A magnetic field that changes along the first coordinate.",
        telltale: "Paths curl one way on one side and the other way on the other; guiding centres drift.",
        reference: "Jackson, Classical Electrodynamics, section 12.4",
        ..GYROSCOPIC
    },
    EffectRow {
        name: "lift_force",
        one_unit: true,
        template: "force {q} += span{ {n}: sqrt({p}^2 + {s}^2)*{s} }; force {r} += span{ {n}: -sqrt({p}^2 + {s}^2)*{p} }",
        why_two: ACROSS,
        physics: "A force across the velocity in proportion to the square of the speed: the lift of a wing or of a ball that spins with its speed.",
        telltale: "Paths curl the same way round everywhere, tighter where the motion is fast.",
        reference: "Batchelor, An Introduction to Fluid Dynamics, section 6.7",
        ..GYROSCOPIC
    },
    EffectRow {
        name: "rotating_frame",
        one_unit: true,
        template: "H += span{ {n}: {r}*{p} - {q}*{s} }",
        why_two: ACROSS,
        physics: "Axes that turn at a steady rate: H loses the rate times the angular momentum.",
        telltale: "Velocities differ from momenta by a turn about the origin; apsides precess.",
        reference: "Landau and Lifshitz, Mechanics, section 39",
        ..GYROSCOPIC
    },
    EffectRow {
        name: "centrifugal_force",
        one_unit: true,
        template: "V += span{ {n}: -({q}^2 + {r}^2)/2 }",
        why_two: "it points away from the axis of a turning plane, which has two coordinates",
        physics: "A force outward in proportion to the distance from the axis of a turning table.",
        telltale: "All oscillations about the axis are slower by the same; the residual force points outward.",
        reference: "Landau and Lifshitz, Mechanics, section 39",
        positive: true,
        ..GYROSCOPIC
    },
];
