//! The mini-language as a whole: print and parse, hostile input, grammar and examples.

use std::fs;
use std::path::Path;

use leverrier::internals::diagnostic::Span;
use leverrier::internals::error::Error;
use leverrier::internals::expr::{FUNCTIONS, FUNCTIONS_OF_TWO, build};
use leverrier::internals::spec::ast::*;
use leverrier::internals::spec::families::FAMILIES;
use leverrier::internals::spec::spec;
use proptest::prelude::*;

fn errors(text: &str) -> Vec<String> {
    match build("test", text) {
        Ok(_) => Vec::new(),
        Err(Error::Spec { diagnostics, .. }) => {
            diagnostics.into_iter().map(|d| d.message).collect()
        }
        Err(other) => panic!("{other}"),
    }
}

const HEAD: &str = "coordinates q; momenta p; T = p^2/2\n";

#[test]
fn deep_nesting_is_an_error_and_no_crash() {
    let deep = [
        format!("V = {}q{}", "(".repeat(100_000), ")".repeat(100_000)),
        format!("V = {}", "(".repeat(100_000)),
        format!("V = {}q", "-".repeat(100_000)),
        format!("V = {}q", "- ".repeat(100_000)),
        format!("V = q{}", "^q".repeat(100_000)),
        format!("V = {}q{}", "sin(".repeat(100_000), ")".repeat(100_000)),
        format!("V = {}q{}", "span{ ".repeat(100_000), "}".repeat(100_000)),
        format!("V = {}1{}", "q[".repeat(100_000), "]".repeat(100_000)),
        format!("V = {}", "sum(q for i in 1..".repeat(50_000)),
        format!("V = span{{ {}", "k: ".repeat(100_000)),
    ];
    for text in deep {
        let found = errors(&format!("{HEAD}{text}"));
        assert!(!found.is_empty() && found.len() < 5, "{}: {found:?}", &text[..20]);
    }
}

#[test]
fn nesting_within_the_limit_works() {
    let text = format!("{HEAD}V = {}q{}", "(".repeat(90), ")".repeat(90));
    assert_eq!(errors(&text), Vec::<String>::new());
    let text = format!("{HEAD}V = {}q{}", "sin(".repeat(90), ")".repeat(90));
    assert_eq!(errors(&text), Vec::<String>::new());
}

#[test]
fn long_is_not_deep() {
    let sum = vec!["q"; 50_000].join(" + ");
    assert_eq!(errors(&format!("{HEAD}V = {sum}")), Vec::<String>::new());
    let product = vec!["q"; 5_000].join("*");
    assert_eq!(errors(&format!("{HEAD}V = {product}")), Vec::<String>::new());
    let lines = "constrain k >= 0\n".repeat(10_000);
    assert_eq!(errors(&format!("{HEAD}V = span{{ k: q }}\n{lines}")), Vec::<String>::new());
}

#[test]
fn a_hundred_thousand_terms_are_lowered() {
    let text = "coordinates q[1..6]; momenta p[1..6]; T = sum(p[i]^2/2 for i in 1..6)
        V = span{ tensor(q; 6) }";
    let compiled = build("test", text).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(compiled.system.terms.len(), 7_usize.pow(6) - 1);
}

#[test]
fn all_statements_with_errors_are_reported_at_once() {
    let found =
        errors("coordinates q; momenta p\nT = pp\nV = span{ cos(r }\nforce q += (1\nT = q +");
    assert!(found.len() >= 4, "{found:?}");
}

#[test]
fn line_ends_and_marks_of_other_systems() {
    let text = "\u{feff}coordinates q\r\nmomenta p # ö\r\nT = p^2/2\r\nV = span{ q^2,\r\n q }\r\n";
    assert_eq!(errors(text), Vec::<String>::new());
}

fn site() -> Site {
    Site(Span::default())
}

fn word(text: String) -> Word {
    Word { text, site: site() }
}

fn plain_name() -> impl Strategy<Value = String> {
    "[a-zA-Zθ_][a-zA-Z0-9_]{0,4}"
        .prop_filter("a name", |name| leverrier::internals::spec::may_name(name))
}

fn unit_text() -> impl Strategy<Value = UnitText> {
    prop::sample::select(vec!["rad/s", "kg*m^2/s^2", "1/s", "N m", "°", "%", "m^(1/2)"])
        .prop_map(|text| word(text.to_string()))
}

fn expression() -> impl Strategy<Value = Expression> {
    let leaf = prop_oneof![
        (0.0..1e20_f64).prop_map(ExpressionKind::Number),
        (0..1000_u32).prop_map(|n| ExpressionKind::Number(f64::from(n))),
        plain_name().prop_map(ExpressionKind::Name),
    ]
    .prop_map(|kind| Expression { kind, site: site() });
    leaf.prop_recursive(4, 40, 4, |inner| {
        let part = (any::<bool>(), inner.clone());
        let several = prop::collection::vec(part, 1..4);
        let join = |(first, rest): (Expression, Vec<(bool, Expression)>)| {
            let mut parts = vec![(false, first)];
            parts.extend(rest);
            parts
        };
        let range = (inner.clone(), inner.clone()).prop_map(|(first, last)| Range {
            first: Box::new(first),
            last: Box::new(last),
            site: site(),
        });
        let binding = (plain_name(), range.clone())
            .prop_map(|(name, range)| Binding { name: word(name), range });
        let relation = prop::sample::select(Relation::ALL.to_vec());
        let comparison = (inner.clone(), relation, inner.clone())
            .prop_map(|(left, relation, right)| Comparison { left, relation, right });
        let comprehension =
            (prop::collection::vec(binding, 1..3), prop::collection::vec(comparison, 0..2))
                .prop_map(|(bindings, conditions)| Comprehension {
                    bindings,
                    conditions,
                    site: site(),
                })
                .boxed();
        let item = (
            prop::option::of(plain_name().prop_map(word)),
            inner.clone(),
            prop::option::of((comprehension.clone(), any::<bool>())),
        )
            .prop_map(|(name, body, comprehension)| Item {
                name,
                body,
                alike: comprehension.as_ref().is_some_and(|(_, alike)| *alike),
                comprehension: comprehension.map(|(comprehension, _)| comprehension),
                site: site(),
            });
        prop_oneof![
            (inner.clone(), several.clone()).prop_map(join).prop_map(ExpressionKind::Sum),
            (inner.clone(), several).prop_map(join).prop_map(ExpressionKind::Product),
            inner.clone().prop_map(|e| ExpressionKind::Negate(Box::new(e))),
            (inner.clone(), inner.clone())
                .prop_map(|(a, b)| ExpressionKind::Power(Box::new(a), Box::new(b))),
            (inner.clone(), unit_text())
                .prop_map(|(e, u)| ExpressionKind::Quantity(Box::new(e), u)),
            (plain_name(), inner.clone())
                .prop_map(|(name, i)| ExpressionKind::Index { name, index: Box::new(i) }),
            (plain_name(), range).prop_map(|(name, range)| ExpressionKind::Slice { name, range }),
            (
                plain_name(),
                prop::collection::vec(inner.clone(), 0..3),
                prop::option::of(inner.clone().prop_map(Box::new))
            )
                .prop_map(|(name, arguments, order)| ExpressionKind::Call {
                    name,
                    arguments,
                    order
                }),
            (inner, comprehension).prop_map(|(body, comprehension)| ExpressionKind::SumOver {
                body: Box::new(body),
                comprehension
            }),
            prop::collection::vec(item, 0..3).prop_map(ExpressionKind::Span),
        ]
        .prop_map(|kind| Expression { kind, site: site() })
    })
}

fn declaration() -> impl Strategy<Value = Declaration> {
    let range = (expression(), expression()).prop_map(|(first, last)| Range {
        first: Box::new(first),
        last: Box::new(last),
        site: site(),
    });
    (plain_name(), prop::option::of(range), prop::option::of(unit_text()))
        .prop_map(|(name, range, unit)| Declaration { name: word(name), range, unit, site: site() })
}

fn variable() -> impl Strategy<Value = Expression> {
    prop_oneof![
        plain_name().prop_map(ExpressionKind::Name),
        (plain_name(), expression())
            .prop_map(|(name, i)| ExpressionKind::Index { name, index: Box::new(i) }),
    ]
    .prop_map(|kind| Expression { kind, site: site() })
}

fn statement() -> impl Strategy<Value = Statement> {
    let text = "[^\"\n\r]{0,12}".prop_map(word).boxed();
    let column = || "[^\"\n\r]{0,8}".prop_map(word);
    let role = prop::sample::select(vec![Role::Coordinates, Role::Momenta, Role::Velocities]);
    let error_column = (column(), prop::option::of(unit_text()))
        .prop_map(|(column, unit)| ErrorColumn { column, unit });
    let data_item = prop_oneof![
        (column(), prop::option::of(unit_text()))
            .prop_map(|(column, unit)| DataItemKind::Time { column, unit }),
        expression().prop_map(DataItemKind::Every),
        column().prop_map(DataItemKind::Run),
        Just(DataItemKind::Pairs),
        variable().prop_map(DataItemKind::NotMeasured),
        (variable(), column(), prop::option::of(unit_text()), prop::option::of(error_column))
            .prop_map(|(variable, column, unit, error)| {
                DataItemKind::Column { variable, column, unit, error }
            }),
    ]
    .prop_map(|kind| DataItem { kind, site: site() });
    let part = || {
        prop::sample::select(vec![
            EnergyPart::Kinetic,
            EnergyPart::Potential,
            EnergyPart::Hamiltonian,
            EnergyPart::Lagrangian,
        ])
    };
    let operand = || {
        prop_oneof![
            expression().prop_map(Operand::Value),
            part().prop_map(|part| Operand::Terms(Target::Energy(part), site())),
            variable().prop_map(|v| Operand::Terms(Target::Force(v), site())),
        ]
    };
    let limits = (prop::option::of(expression()), prop::option::of(expression()))
        .prop_map(|(lower, upper)| Limits { lower, upper, site: site() });
    let relation = || prop::sample::select(Relation::ALL.to_vec());
    let sensor = || {
        (variable(), expression()).prop_map(|(observable, value)| StatementKind::Sensor {
            observable,
            value,
            comprehension: None,
        })
    };
    let setting = (plain_name(), expression()).prop_map(|(name, value)| Setting {
        name: word(name),
        value,
        site: site(),
    });
    let parameter = || {
        (plain_name(), expression()).prop_map(|(name, start)| StatementKind::Parameter {
            name: word(name),
            per: None,
            starts: vec![start],
            bounds: None,
        })
    };
    let addition = prop_oneof![
        sensor(),
        parameter(),
        (part(), expression()).prop_map(|(part, value)| StatementKind::Energy {
            part,
            adds: true,
            value
        }),
    ]
    .prop_map(|kind| Statement { kind, site: site(), effect: None });
    let candidate = (plain_name(), prop::collection::vec(addition, 1..3))
        .prop_map(|(name, statements)| Candidate { name: word(name), statements, site: site() });
    let argument = prop_oneof![
        variable().prop_map(Argument::Variable),
        prop::collection::vec(variable(), 1..3).prop_map(|list| Argument::Body(list, site())),
    ];
    prop_oneof![
        sensor(),
        (plain_name(), prop::collection::vec(variable(), 1..4)).prop_map(|(name, coordinates)| {
            StatementKind::Body { name: word(name), coordinates }
        }),
        (plain_name(), prop::collection::vec(argument, 0..3), prop::collection::vec(setting, 0..3))
            .prop_map(|(name, arguments, settings)| StatementKind::Effect {
                name: word(name),
                arguments,
                settings
            }),
        (plain_name(), prop::option::of(unit_text()), expression(), any::<bool>()).prop_map(
            |(name, unit, value, wrapped)| StatementKind::Measure {
                name: word(name),
                unit,
                value,
                wrapped
            }
        ),
        prop::collection::vec(candidate, 0..3).prop_map(StatementKind::Candidates),
        text.clone().prop_map(StatementKind::System),
        (role, prop::collection::vec(declaration(), 1..3))
            .prop_map(|(role, list)| StatementKind::Variables { role, list }),
        (plain_name(), prop::option::of(unit_text()))
            .prop_map(|(name, unit)| StatementKind::Time { name: word(name), unit }),
        (text, prop::collection::vec(data_item, 0..4))
            .prop_map(|(file, items)| StatementKind::Data { file, items }),
        (plain_name(), expression(), any::<bool>()).prop_map(|(name, value, by_let)| {
            StatementKind::Constant { name: word(name), value, by_let }
        }),
        (
            plain_name(),
            prop::option::of(prop_oneof![plain_name(), Just("a b".to_string())]),
            prop::collection::vec(expression(), 0..3),
            prop::option::of(limits)
        )
            .prop_filter("a shared number has a start", |(_, per, starts, _)| {
                per.is_some() || !starts.is_empty()
            })
            .prop_map(|(name, per, starts, bounds)| StatementKind::Parameter {
                name: word(name),
                per: per.map(word),
                starts,
                bounds
            }),
        (part(), any::<bool>(), expression())
            .prop_map(|(part, adds, value)| StatementKind::Energy { part, adds, value }),
        (variable(), any::<bool>(), expression()).prop_map(|(coordinate, adds, value)| {
            StatementKind::Force { coordinate, adds, value, comprehension: None }
        }),
        (operand(), prop::collection::vec((relation(), operand()), 1..3))
            .prop_map(|(first, rest)| StatementKind::Constrain { first, rest }),
    ]
    .prop_map(|kind| Statement { kind, site: site(), effect: None })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn a_printed_spec_parses_back_to_itself(statements in prop::collection::vec(statement(), 0..5)) {
        let tree = SyntaxTree { statements, ..SyntaxTree::default() };
        let text = tree.to_string();
        let (read, diagnostics) = spec(&text);
        prop_assert!(diagnostics.is_empty(), "{}\n{:?}", text, diagnostics);
        prop_assert_eq!(read, tree, "{}", text);
    }

    #[test]
    fn no_text_breaks_the_parser(text in "\\PC{0,60}") {
        let _ = build("test", &text);
    }

    #[test]
    fn no_pieces_break_the_compiler(pieces in prop::collection::vec(prop::sample::select(vec![
        "T", "V", "=", "+=", "span{", "}", "(", ")", "q", "p", "[", "]", "1", "..", "for", "in", "i",
        "sum", "poly", ";", ",", "^", "-", "0", "1e308", "*", "/", "sin", "log", "\n", "where", "k:",
        "constrain", "force", "sensor", "measure", "{ wrapped }", "atan2(", "effect", "candidates {", "rate(", "delayed(", "viscous_drag(q)", "param", "a", "where", "[m]", "[s]", " ", "trig(q; 2)", "tensor(q; 3)",
    ]), 0..40)) {
        let text = pieces.join(" ");
        let _ = build("test", &format!("coordinates q [m], r[1..3]; momenta p [kg*m/s], s[1..3]; time t [s]\nT = p^2/2; V += {text}"));
    }
}

fn root(path: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn read(path: &str) -> String {
    fs::read_to_string(root(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// Left-hand sides of the grammar.
fn productions() -> Vec<String> {
    read("grammar/leverrier.ebnf")
        .lines()
        .filter_map(|line| line.split_once(" =").map(|(name, _)| name.trim().to_string()))
        .filter(|name| !name.is_empty() && name.chars().all(|c| c.is_ascii_lowercase() || c == '_'))
        .collect()
}

#[test]
fn every_parser_function_that_names_a_production_stands_in_the_grammar() {
    let productions = productions();
    let mut found = 0;
    for file in ["mod.rs", "statement.rs", "expression.rs", "token.rs"] {
        let source = read(&format!("src/spec/parse/{file}"));
        for line in source.lines().filter_map(|line| line.strip_prefix("/// ")) {
            let Some((name, _)) = line.split_once(" = ") else { continue };
            assert!(productions.iter().any(|production| production == name), "{name} in {file}");
            assert!(source.contains(&format!("fn {name}")), "{name} has no function in {file}");
            found += 1;
        }
    }
    assert!(found >= 30, "only {found} productions have functions");
}

#[test]
fn every_production_has_an_example_that_parses() {
    for production in productions() {
        let path = format!("grammar/examples/{production}.ham");
        let text = read(&path);
        let (_, diagnostics) = spec(&text);
        assert!(diagnostics.is_empty(), "{path}: {diagnostics:?}");
        if let Err(error) = build(&path, &text) {
            panic!("{path}: {error}");
        }
    }
}

/// Lines that are made from the tables of functions and families: (file, how the line begins,
/// the rest of it).
fn lines_of_tables() -> Vec<(&'static str, &'static str, String)> {
    let families: Vec<&str> = FAMILIES.iter().map(|row| row.name).collect();
    let functions: Vec<&str> = FUNCTIONS.iter().map(|row| row.name).collect();
    let aliases = || FUNCTIONS.iter().flat_map(|row| row.aliases.iter().map(|a| (*a, row.name)));
    let mut words = functions.clone();
    words.extend(aliases().map(|(alias, _)| alias));
    words.extend(FUNCTIONS_OF_TWO.iter().map(|row| row.name));
    words.extend(["rate", "delayed"]);
    let other: Vec<String> = aliases().map(|(alias, name)| format!("{alias} is {name}")).collect();
    let quoted: Vec<String> = functions.iter().map(|name| format!("`{name}`")).collect();
    let (textmate, vim) = ("grammar/leverrier.tmLanguage.json", "grammar/leverrier.vim");
    let calls = |words: &[&str]| format!(r#"({})\\b(?=\\()""#, words.join("|"));
    vec![
        (textmate, r#""match": "\\b(poly"#, calls(&families)),
        (textmate, r#""match": "\\b(sin"#, calls(&words)),
        (vim, "syn keyword leverrierFamily", format!(" {}", families.join(" "))),
        (vim, "syn keyword leverrierFunction", format!(" {}", words.join(" "))),
        (
            "grammar/leverrier.ebnf",
            "Functions of one argument:",
            format!(" {}.", functions.join(", ")),
        ),
        ("grammar/leverrier.ebnf", "Other names of functions:", format!(" {}.", other.join(", "))),
        ("README.md", "| functions |", format!(" {} |", quoted.join(" "))),
    ]
}

/// `LEVERRIER_UPDATE=1` writes the lines anew.
#[test]
fn grammars_and_the_readme_list_what_the_tables_hold() {
    let update = std::env::var_os("LEVERRIER_UPDATE").is_some();
    for (file, beginning, rest) in lines_of_tables() {
        let text = read(file);
        // A regular expression begins with the first of its words.
        let head = beginning.rsplit_once('(').map_or(beginning, |(head, _)| head);
        let expected: String = text
            .split_inclusive('\n')
            .map(|line| match line.trim_start() {
                found if found.starts_with(beginning) => {
                    let indent = &line[..line.len() - found.len()];
                    format!("{indent}{head}{rest}\n")
                }
                _ => line.to_string(),
            })
            .collect();
        let lines = text.lines().filter(|line| line.trim_start().starts_with(beginning)).count();
        assert_eq!(lines, 1, "{file} has {lines} lines that begin with `{beginning}`");
        if text != expected {
            assert!(update, "{file}: `{head}{rest}` is wanted; LEVERRIER_UPDATE=1 writes it");
            fs::write(root(file), expected).unwrap_or_else(|e| panic!("{file}: {e}"));
        }
    }
}

#[test]
fn highlighting_knows_every_word() {
    let words = [
        "coordinates",
        "velocities",
        "sensor",
        "measure",
        "input",
        "band_limited",
        "effect",
        "candidates",
        "constrain",
        "span",
        "rate",
        "delayed",
    ];
    for file in ["grammar/leverrier.tmLanguage.json", "grammar/leverrier.vim"] {
        let text = read(file);
        for word in words {
            assert!(text.contains(word), "{file} does not know `{word}`");
        }
    }
    let json =
        serde_json::from_str::<serde_json::Value>(&read("grammar/leverrier.tmLanguage.json"));
    assert!(json.is_ok(), "{json:?}");
}
