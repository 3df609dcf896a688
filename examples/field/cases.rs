//! The records, one row each.

use super::Asked;

/// A record and what is asked of it.
pub(crate) struct Case {
    pub title: &'static str,
    /// Its file.
    pub file: &'static str,
    /// What is known of the rig.
    pub known: &'static str,
    pub asked: Asked,
    pub spec: &'static str,
    /// What is added to it.
    pub with: &'static str,
}

impl Case {
    /// The whole spec.
    pub(crate) fn text(&self) -> String {
        format!("{}{}", self.spec, self.with)
    }
}

const TORQUE: &str = "coordinates theta [rad]
momenta p
time t [s]
input tau [N m] { linear }
data \"torque_pendulum.csv\" { time time  theta = position  p not measured  tau = torque }
param J = 0.05 in 0.01..1
T = p^2/(2*J)
V = span{ cos(theta) }
force theta += tau
";

const WHEEL: &str = "coordinates q [rad]
momenta p [rad/s]
time t [s]
data \"wheel_400mA.csv\" { time \"Zeit t\" [s]  q = \"Weg &b_A1\"  p not measured }
T = p^2/2
V = span{ q, q^2, q^4 }
";

const DRIVEN_WHEEL: &str = "coordinates q [rad]
momenta p [rad/s]
time t [s]
input u [V] { linear }
data \"wheel_forced.csv\" { time \"Zeit t\" [s]  q = \"Weg &b_A1\"  p not measured  u = \"Spannung U_B1\" }
T = p^2/2
V = span{ q, q^2, q^4 }
force q += span{ u }
";

const FAN: &str = "coordinates theta [rad]
momenta p
time t [s]
input u { linear }
data \"fan_pendulum.mat\" { time t  theta = yrad  p not measured }
param lag = 0.05 [s] in 0.01..1
state w { w' = (u^2 - w)/lag }
T = p^2/2
V = span{ cos(theta) }
force theta += span{ thrust: w, dry: -sign(p) }
";

const STAR: &str = "coordinates x, y
momenta px, py
time t
data \"s2_star.csv\" { time t  x = x error x_err  y = y error y_err  px not measured  py not measured }
param GM = 5e-4 in 1e-5..1e-2
T = (px^2 + py^2)/2
V = -GM/sqrt(x^2 + y^2)
";

const FILM: &str = "coordinates theta [rad]
momenta p
time t [s]
data \"filmed_pendulum.csv\" { time t  theta = theta  p not measured }
T = p^2/2
V = span{ cos(theta) }
";

const CLEAN: &str = "coordinates theta
momenta omega
time t
data \"damped_clean.csv\" { time t }
T = omega^2/2
V = span{ cos(theta) }
";

const CLEAN_DUFFING: &str = "coordinates x
momenta v
time t
data \"duffing_clean.csv\" { time t }
T = v^2/2
V = span{ poly(x; 4) }
";

const NOISY_DUFFING: &str = "coordinates x
momenta v
time t
data \"duffing_noisy.csv\" { time t }
T = v^2/2
V = span{ poly(x; 4) }
";

/// One row for each question.
pub(crate) const CASES: &[Case] = &[
    Case {
        title: "a pendulum on a motor",
        file: "torque_pendulum.csv",
        known: "J 0.133 to 0.140, m g l 2.1 to 2.5, dry friction 0.19",
        asked: Asked::Fit,
        spec: TORQUE,
        with: "",
    },
    Case {
        title: "the same pendulum",
        file: "torque_pendulum.csv",
        known: "dry friction",
        asked: Asked::Discover,
        spec: TORQUE,
        with: "",
    },
    Case {
        title: "Pohl's wheel with its frictions",
        file: "wheel_400mA.csv",
        known: "q^2 5.33, viscous 0.42, dry 0.03",
        asked: Asked::Fit,
        spec: WHEEL,
        with: "force q += span{ viscous: -p, dry: -sign(p) }\n",
    },
    Case {
        title: "Pohl's wheel",
        file: "wheel_400mA.csv",
        known: "viscous and dry friction",
        asked: Asked::Discover,
        spec: WHEEL,
        with: "",
    },
    Case {
        title: "Pohl's wheel, driven, with its friction",
        file: "wheel_forced.csv",
        known: "viscous 0.105",
        asked: Asked::Fit,
        spec: DRIVEN_WHEEL,
        with: "force q += span{ viscous: -p }\n",
    },
    Case {
        title: "Pohl's wheel, driven",
        file: "wheel_forced.csv",
        known: "viscous friction",
        asked: Asked::Discover,
        spec: DRIVEN_WHEEL,
        with: "",
    },
    Case {
        title: "a pendulum blown by a fan",
        file: "fan_pendulum.mat",
        known: "-cos 87, lag 0.107, dry 1.4",
        asked: Asked::Fit,
        spec: FAN,
        with: "",
    },
    Case {
        title: "a star round a black hole",
        file: "s2_star.csv",
        known: "GM 2.8e-4 to 3.0e-4",
        asked: Asked::Fit,
        spec: STAR,
        with: "",
    },
    Case {
        title: "a filmed pendulum",
        file: "filmed_pendulum.csv",
        known: "quadratic drag 0.018 to 0.023, little viscous",
        asked: Asked::Discover,
        spec: FILM,
        with: "",
    },
    Case {
        title: "a damped pendulum, solver output at its default tolerance",
        file: "damped_clean.csv",
        known: "viscous drag 0.1",
        asked: Asked::Discover,
        spec: CLEAN,
        with: "",
    },
    Case {
        title: "a driven Duffing oscillator, solver output",
        file: "duffing_clean.csv",
        known: "viscous drag 0.3, drive 0.1 of frequency 1.2",
        asked: Asked::Discover,
        spec: CLEAN_DUFFING,
        with: "",
    },
    Case {
        title: "the same with noise",
        file: "duffing_noisy.csv",
        known: "viscous drag 0.3, drive 0.1 of frequency 1.2",
        asked: Asked::Discover,
        spec: NOISY_DUFFING,
        with: "",
    },
];
