//! Integration methods as rows of one table.

use std::fmt;

/// One integration method.
///
/// ```
/// use leverrier::Method;
///
/// assert_eq!(Method::by_name("leapfrog").map(|method| method.to_string()).as_deref(), Some("leapfrog"));
/// assert_eq!(Method::by_name("guess"), None);
/// ```
#[derive(Debug)]
pub struct MethodRow {
    /// Its name in output and options.
    pub name: &'static str,
    /// Order of the global error in the step.
    pub order: u32,
    /// A step forward and the same step backward cancel.
    pub symmetric: bool,
    /// The map preserves the symplectic form of every Hamiltonian that the kind applies to.
    pub symplectic: bool,
    /// How it steps.
    pub kind: MethodKind,
    /// Paper and equation.
    pub source: &'static str,
}

impl MethodRow {
    /// The tableau of a Runge-Kutta method.
    pub fn tableau(&self) -> Option<&Tableau> {
        match &self.kind {
            MethodKind::Splitting(_) => None,
            MethodKind::Implicit(tableau) | MethodKind::Explicit(tableau) => Some(tableau),
        }
    }
}

/// How a method steps, with its coefficients.
#[derive(Debug)]
pub enum MethodKind {
    /// A composition of leapfrog steps of lengths `coefficient * h`; for separable dynamics.
    Splitting(&'static [f64]),
    /// Implicit Runge-Kutta; for any dynamics.
    Implicit(Tableau),
    /// Explicit Runge-Kutta; for any dynamics.
    Explicit(Tableau),
}

/// A Butcher tableau of s stages.
#[derive(Debug, PartialEq)]
pub struct Tableau {
    /// `[s][s]`, row after row.
    pub matrix: &'static [f64],
    /// Weights, `[s]`.
    pub weights: &'static [f64],
    /// Times of the stages in units of the step, `[s]`.
    pub nodes: &'static [f64],
}

impl Tableau {
    /// Whether each stage needs only the stages before it.
    pub fn is_explicit(&self) -> bool {
        let count = self.weights.len();
        (0..count * count).all(|i| i % count < i / count || self.matrix[i] == 0.0)
    }
}

/// An integration method: a row of [`METHODS`].
/// The default is the first row.
///
/// ```
/// use leverrier::{Method, Options};
///
/// let options = Options { method: Method::by_name("leapfrog"), ..Options::default() };
/// assert!(options.method.is_some());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct Method(u8);

impl Method {
    /// Looks a name of the table up.
    ///
    /// ```
    /// use leverrier::Method;
    ///
    /// assert!(Method::by_name("gauss-legendre-4").is_some());
    /// assert_eq!(Method::by_name("euler"), None);
    /// ```
    pub fn by_name(name: &str) -> Option<Method> {
        METHODS.iter().position(|row| row.name == name).map(|i| Method(i as u8))
    }

    /// Every method of the table.
    #[doc(hidden)]
    pub fn all() -> impl Iterator<Item = Method> {
        (0..METHODS.len()).map(|i| Method(i as u8))
    }

    /// The table row.
    #[doc(hidden)]
    pub fn row(self) -> &'static MethodRow {
        &METHODS[self.0 as usize]
    }

    /// Whether the method applies to separable dynamics only.
    #[doc(hidden)]
    pub fn needs_separable(self) -> bool {
        matches!(self.row().kind, MethodKind::Splitting(_))
    }

    /// Force evaluations that one step takes, an implicit stage counted with its iterations.
    #[doc(hidden)]
    pub fn cost(self) -> usize {
        match &self.row().kind {
            MethodKind::Splitting(gammas) => gammas.len(),
            MethodKind::Explicit(tableau) => tableau.weights.len(),
            MethodKind::Implicit(tableau) => 5 * tableau.weights.len(),
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.row().name)
    }
}

/// 1 / (2 - 2^(1/3)).
const YOSHIDA_4: f64 = 1.351_207_191_959_657_6;

const SQRT_3: f64 = 1.732_050_807_568_877_2;
const SQRT_15: f64 = 3.872_983_346_207_417;
const SQRT_21: f64 = 4.582_575_694_955_84;

/// The square matrix, row after row, of an explicit method from its rows below the first, each
/// up to the diagonal; N is S * S.
const fn lower<const S: usize, const N: usize>(rows: &[&[f64]]) -> [f64; N] {
    let mut out = [0.0; N];
    let mut i = 0;
    while i < rows.len() {
        let mut j = 0;
        while j < rows[i].len() {
            out[(i + 1) * S + j] = rows[i][j];
            j += 1;
        }
        i += 1;
    }
    out
}

/// The middle weight that makes a symmetric composition sum to 1.
const fn rest(outer: &[f64]) -> f64 {
    let (mut sum, mut i) = (0.0, 0);
    while i < outer.len() {
        sum += outer[i];
        i += 1;
    }
    1.0 - 2.0 * sum
}

/// outer, centre, outer backward; N is 2 * outer + 1.
const fn symmetric<const N: usize>(outer: &[f64]) -> [f64; N] {
    let mut out = [rest(outer); N];
    let mut i = 0;
    while i < outer.len() {
        out[i] = outer[i];
        out[N - 1 - i] = outer[i];
        i += 1;
    }
    out
}

/// Every integration method. A new one is one row here; the tests measure it by themselves.
#[expect(clippy::excessive_precision, reason = "digits as the sources print them")]
pub static METHODS: &[MethodRow] = &[
    MethodRow {
        name: "leapfrog",
        order: 2,
        symmetric: true,
        symplectic: true,
        kind: MethodKind::Splitting(&[1.0]),
        source: "Verlet, Phys. Rev. 159 (1967) 98, eq. 4; as drift, kick, drift",
    },
    MethodRow {
        name: "forest-ruth",
        order: 4,
        symmetric: true,
        symplectic: true,
        kind: MethodKind::Splitting(&symmetric::<3>(&[YOSHIDA_4])),
        source: "Forest and Ruth, Physica D 43 (1990) 105; Yoshida, Phys. Lett. A 150 (1990) 262, eq. 2.11",
    },
    MethodRow {
        name: "yoshida-6",
        order: 6,
        symmetric: true,
        symplectic: true,
        kind: MethodKind::Splitting(&symmetric::<7>(&[
            0.784_513_610_477_560,
            0.235_573_213_359_357,
            -1.177_679_984_178_87,
        ])),
        source: "Yoshida, Phys. Lett. A 150 (1990) 262, table 1, solution A",
    },
    MethodRow {
        name: "kahan-li-6",
        order: 6,
        symmetric: true,
        symplectic: true,
        kind: MethodKind::Splitting(&symmetric::<9>(&[
            0.392_161_444_007_314_139_279_250_56,
            0.332_599_136_789_359_438_599_748_64,
            -0.706_246_172_557_639_359_809_964_82,
            0.082_213_596_293_550_800_231_490_45,
        ])),
        source: "Kahan and Li, Math. Comp. 66 (1997) 1089, s9odr6a",
    },
    MethodRow {
        name: "suzuki-umeno-8",
        order: 8,
        symmetric: true,
        symplectic: true,
        kind: MethodKind::Splitting(&symmetric::<15>(&[
            0.741_670_364_350_612_953_448_227_80,
            -0.409_100_825_800_031_593_997_300_10,
            0.190_754_710_296_238_379_953_876_26,
            -0.573_862_471_116_082_266_656_387_73,
            0.299_064_181_303_655_923_844_463_54,
            0.334_624_918_245_298_183_784_957_98,
            0.315_293_092_396_766_596_632_056_66,
        ])),
        source: "Suzuki and Umeno (1993); Hairer, Lubich, Wanner, Geometric Numerical Integration, eq. V.3.11",
    },
    MethodRow {
        name: "gauss-legendre-4",
        order: 4,
        symmetric: true,
        symplectic: true,
        kind: MethodKind::Implicit(Tableau {
            matrix: &[0.25, 0.25 - SQRT_3 / 6.0, 0.25 + SQRT_3 / 6.0, 0.25],
            weights: &[0.5, 0.5],
            nodes: &[0.5 - SQRT_3 / 6.0, 0.5 + SQRT_3 / 6.0],
        }),
        source: "Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, table II.7.3",
    },
    MethodRow {
        name: "gauss-legendre-6",
        order: 6,
        symmetric: true,
        symplectic: true,
        kind: MethodKind::Implicit(Tableau {
            matrix: &[
                5.0 / 36.0,
                2.0 / 9.0 - SQRT_15 / 15.0,
                5.0 / 36.0 - SQRT_15 / 30.0,
                5.0 / 36.0 + SQRT_15 / 24.0,
                2.0 / 9.0,
                5.0 / 36.0 - SQRT_15 / 24.0,
                5.0 / 36.0 + SQRT_15 / 30.0,
                2.0 / 9.0 + SQRT_15 / 15.0,
                5.0 / 36.0,
            ],
            weights: &[5.0 / 18.0, 4.0 / 9.0, 5.0 / 18.0],
            nodes: &[0.5 - SQRT_15 / 10.0, 0.5, 0.5 + SQRT_15 / 10.0],
        }),
        source: "Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, table II.7.4",
    },
    MethodRow {
        name: "rk4",
        order: 4,
        symmetric: false,
        symplectic: false,
        kind: MethodKind::Explicit(Tableau {
            matrix: &[
                0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0,
            ],
            weights: &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
            nodes: &[0.0, 0.5, 0.5, 1.0],
        }),
        source: "Kutta, Z. Math. Phys. 46 (1901) 435; Hairer, Norsett, Wanner I, table II.1.2",
    },
    MethodRow {
        name: "butcher-6",
        order: 6,
        symmetric: false,
        symplectic: false,
        kind: MethodKind::Explicit(Tableau {
            matrix: &lower::<7, 49>(&[
                &[1.0 / 3.0],
                &[0.0, 2.0 / 3.0],
                &[1.0 / 12.0, 1.0 / 3.0, -1.0 / 12.0],
                &[-1.0 / 16.0, 9.0 / 8.0, -3.0 / 16.0, -3.0 / 8.0],
                &[0.0, 9.0 / 8.0, -3.0 / 8.0, -3.0 / 4.0, 1.0 / 2.0],
                &[9.0 / 44.0, -9.0 / 11.0, 63.0 / 44.0, 18.0 / 11.0, 0.0, -16.0 / 11.0],
            ]),
            weights: &[
                11.0 / 120.0,
                0.0,
                27.0 / 40.0,
                27.0 / 40.0,
                -4.0 / 15.0,
                -4.0 / 15.0,
                11.0 / 120.0,
            ],
            nodes: &[0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0 / 3.0, 0.5, 0.5, 1.0],
        }),
        source: "Butcher, J. Austral. Math. Soc. 4 (1964) 179",
    },
    MethodRow {
        name: "cooper-verner-8",
        order: 8,
        symmetric: false,
        symplectic: false,
        kind: MethodKind::Explicit(Tableau {
            matrix: &lower::<11, 121>(&[
                &[0.5],
                &[0.25, 0.25],
                &[1.0 / 7.0, (-7.0 - 3.0 * SQRT_21) / 98.0, (21.0 + 5.0 * SQRT_21) / 49.0],
                &[
                    (11.0 + SQRT_21) / 84.0,
                    0.0,
                    (18.0 + 4.0 * SQRT_21) / 63.0,
                    (21.0 - SQRT_21) / 252.0,
                ],
                &[
                    (5.0 + SQRT_21) / 48.0,
                    0.0,
                    (9.0 + SQRT_21) / 36.0,
                    (-231.0 + 14.0 * SQRT_21) / 360.0,
                    (63.0 - 7.0 * SQRT_21) / 80.0,
                ],
                &[
                    (10.0 - SQRT_21) / 42.0,
                    0.0,
                    (-432.0 + 92.0 * SQRT_21) / 315.0,
                    (633.0 - 145.0 * SQRT_21) / 90.0,
                    (-504.0 + 115.0 * SQRT_21) / 70.0,
                    (63.0 - 13.0 * SQRT_21) / 35.0,
                ],
                &[
                    1.0 / 14.0,
                    0.0,
                    0.0,
                    0.0,
                    (14.0 - 3.0 * SQRT_21) / 126.0,
                    (13.0 - 3.0 * SQRT_21) / 63.0,
                    1.0 / 9.0,
                ],
                &[
                    1.0 / 32.0,
                    0.0,
                    0.0,
                    0.0,
                    (91.0 - 21.0 * SQRT_21) / 576.0,
                    11.0 / 72.0,
                    (-385.0 - 75.0 * SQRT_21) / 1152.0,
                    (63.0 + 13.0 * SQRT_21) / 128.0,
                ],
                &[
                    1.0 / 14.0,
                    0.0,
                    0.0,
                    0.0,
                    1.0 / 9.0,
                    (-733.0 - 147.0 * SQRT_21) / 2205.0,
                    (515.0 + 111.0 * SQRT_21) / 504.0,
                    (-51.0 - 11.0 * SQRT_21) / 56.0,
                    (132.0 + 28.0 * SQRT_21) / 245.0,
                ],
                &[
                    0.0,
                    0.0,
                    0.0,
                    0.0,
                    (-42.0 + 7.0 * SQRT_21) / 18.0,
                    (-18.0 + 28.0 * SQRT_21) / 45.0,
                    (-273.0 - 53.0 * SQRT_21) / 72.0,
                    (301.0 + 53.0 * SQRT_21) / 72.0,
                    (28.0 - 28.0 * SQRT_21) / 45.0,
                    (49.0 - 7.0 * SQRT_21) / 18.0,
                ],
            ]),
            weights: &[
                1.0 / 20.0,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                49.0 / 180.0,
                16.0 / 45.0,
                49.0 / 180.0,
                1.0 / 20.0,
            ],
            nodes: &[
                0.0,
                0.5,
                0.5,
                (7.0 + SQRT_21) / 14.0,
                (7.0 + SQRT_21) / 14.0,
                0.5,
                (7.0 - SQRT_21) / 14.0,
                (7.0 - SQRT_21) / 14.0,
                0.5,
                (7.0 + SQRT_21) / 14.0,
                1.0,
            ],
        }),
        source: "Cooper and Verner, SIAM J. Numer. Anal. 9 (1972) 389",
    },
];
