//! Edits a spec as text, so that every comment and blank line stays.

use super::ast::{Expression, ExpressionKind, Item, Statement, StatementKind};
use super::parse::spec;
use crate::diagnostic::Span;

/// Adds a statement on a line of its own, after the last energy, force, sensor or effect.
///
/// A comment behind that statement stays on its line. Without such a statement, the new
/// one goes to the end of the text.
pub fn insert(text: &str, statement: &str) -> String {
    let (tree, _) = spec(text);
    let last = tree
        .statements
        .iter()
        .filter(|statement| {
            matches!(
                statement.kind,
                StatementKind::Energy { .. }
                    | StatementKind::Force { .. }
                    | StatementKind::Sensor { .. }
                    | StatementKind::Effect { .. }
            )
        })
        .map(|statement| statement.site.0.end)
        .max();
    let at = last.and_then(|end| text.get(end..)?.find('\n').map(|line_end| end + line_end + 1));
    let (before, after) = text.split_at(at.unwrap_or(text.len()));
    let gap = if before.is_empty() || before.ends_with('\n') { "" } else { "\n" };
    format!("{before}{gap}{statement}\n{after}")
}

/// Takes a statement away: its whole line where it stands alone on it, else only itself
/// and one separator. A comment on the line stays.
pub fn remove(text: &str, span: Span) -> String {
    let (Some(before), Some(after)) = (text.get(..span.start), text.get(span.end..)) else {
        return text.to_string();
    };
    let (lines, head) = last_line(before);
    let (tail, rest) = after.split_once('\n').unwrap_or((after, ""));
    if head.trim().is_empty() && tail.trim().is_empty() {
        return format!("{lines}{rest}");
    }
    let rest = after.trim_start_matches([' ', '\t']);
    if let Some(rest) = rest.strip_prefix(';') {
        return format!("{before}{}", rest.trim_start_matches([' ', '\t']));
    }
    let kept = before.trim_end_matches([' ', '\t']);
    match kept.strip_suffix(';') {
        Some(kept) => format!("{}{after}", kept.trim_end_matches([' ', '\t'])),
        None => format!("{before}{rest}"),
    }
}

/// Puts `new` in the place of what stands at `span`: an expression, an item list, a number.
pub fn replace(text: &str, span: Span, new: &str) -> String {
    match (text.get(..span.start), text.get(span.end..)) {
        (Some(before), Some(after)) => format!("{before}{new}{after}"),
        _ => text.to_string(),
    }
}

/// The statements of a text that `wanted` accepts, with their places.
pub fn find(text: &str, wanted: impl Fn(&Statement) -> bool) -> Vec<Statement> {
    let (tree, _) = spec(text);
    tree.statements.into_iter().filter(|statement| wanted(statement)).collect()
}

/// Where a text says what `statement` says; the last such place.
///
/// Statements are compared as they are read: a comment that mentions one is none, and
/// blanks make no difference. `None` where none says the same.
pub fn place_of(text: &str, statement: &str) -> Option<Span> {
    let wanted = spec(statement).0.statements;
    let [wanted] = wanted.as_slice() else { return None };
    find(text, |statement| statement == wanted).last().map(|statement| statement.site.0)
}

/// Takes a term with a name (`stiffness: q^2`) out of the function space that it stands in,
/// with its comma; a force or sensor that has no other term goes as a whole. Comments stay.
///
/// `None` where no term of an energy, force or sensor has that name.
pub fn remove_term(text: &str, name: &str) -> Option<String> {
    let (tree, _) = spec(text);
    for statement in &tree.statements {
        let (value, movable) = match &statement.kind {
            StatementKind::Energy { value, .. } => (value, false),
            StatementKind::Force { value, .. } | StatementKind::Sensor { value, .. } => {
                (value, true)
            }
            _ => continue,
        };
        let mut spans = Vec::new();
        spans_of(value, &mut spans);
        let named = |item: &Item| item.name.as_ref().is_some_and(|word| word.text == name);
        for items in spans {
            let Some(item) = items.iter().find(|item| named(item)) else { continue };
            let alone = items.len() == 1 && matches!(value.kind, ExpressionKind::Span(_));
            if alone && movable {
                return Some(remove(text, statement.site.0));
            }
            return Some(remove_item(text, item.site.0));
        }
    }
    None
}

/// Names of the terms of energies, forces and sensors.
pub fn term_names(text: &str) -> Vec<String> {
    let (tree, _) = spec(text);
    let mut spans = Vec::new();
    for statement in &tree.statements {
        if let StatementKind::Energy { value, .. }
        | StatementKind::Force { value, .. }
        | StatementKind::Sensor { value, .. } = &statement.kind
        {
            spans_of(value, &mut spans);
        }
    }
    let items = spans.into_iter().flatten();
    items.filter_map(|item| Some(item.name.as_ref()?.text.clone())).collect()
}

/// Every function space of an expression.
fn spans_of<'a>(value: &'a Expression, out: &mut Vec<&'a [Item]>) {
    match &value.kind {
        ExpressionKind::Span(items) => out.push(items),
        ExpressionKind::Negate(inner) => spans_of(inner, out),
        ExpressionKind::Sum(parts) | ExpressionKind::Product(parts) => {
            parts.iter().for_each(|(_, part)| spans_of(part, out));
        }
        _ => {}
    }
}

/// A text cut before its last line, which may be empty.
fn last_line(text: &str) -> (&str, &str) {
    text.split_at(text.rfind('\n').map_or(0, |at| at + 1))
}

/// Takes an item of a list away, and the comma that parted it from its neighbour.
fn remove_item(text: &str, span: Span) -> String {
    let (Some(before), Some(after)) = (text.get(..span.start), text.get(span.end..)) else {
        return text.to_string();
    };
    let tail = after.trim_start();
    let (before, after) = match tail.strip_prefix(',') {
        Some(rest) => (before, rest),
        // The last of the list: the comma stands before it, unless a comment comes between.
        None => (before.trim_end().strip_suffix(',').unwrap_or(before), after),
    };
    let (lines, head) = last_line(before);
    if let Some((tail, rest)) = after.split_once('\n')
        && head.trim().is_empty()
        && tail.trim().is_empty()
    {
        return format!("{lines}{rest}");
    }
    // One of the two blanks around it.
    let blank = before.ends_with([' ', '\t']);
    let after = after.strip_prefix(' ').filter(|_| blank).unwrap_or(after);
    format!("{before}{after}")
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOTEBOOK: &str = "\
# bench, 3 May
coordinates q ; momenta p   # two in a line

T = p^2/2     # known
V = span{     # searched
    q^2,      # stiffness
    q^4
}  # end of V

# trailing remark
";

    const FORCE: &str = "force q += span{ -p }";

    #[test]
    fn an_inserted_statement_follows_the_last_force_or_energy() {
        let edited = insert(NOTEBOOK, FORCE);
        assert!(
            edited.contains(&format!("}}  # end of V\n{FORCE}\n\n# trailing remark")),
            "{edited}"
        );
        assert!(spec(&edited).1.is_empty());
        assert_eq!(insert("T = p", FORCE), format!("T = p\n{FORCE}\n"));
        assert_eq!(insert("", FORCE), format!("{FORCE}\n"));
    }

    #[test]
    fn what_was_inserted_can_be_removed_without_a_trace() {
        let edited = insert(NOTEBOOK, FORCE);
        let forces = find(&edited, |s| matches!(s.kind, StatementKind::Force { .. }));
        assert_eq!(forces.len(), 1);
        assert_eq!(remove(&edited, forces[0].site.0), NOTEBOOK);
    }

    #[test]
    fn a_statement_is_found_where_it_stands_and_not_where_a_comment_names_it() {
        let text = format!("# {FORCE} is next\n{}", insert(NOTEBOOK, FORCE));
        let place = place_of(&text, "force q  += span{-p}").expect("it stands there");
        assert_eq!(remove(&text, place), format!("# {FORCE} is next\n{NOTEBOOK}"));
        assert!(replace(&text, place, "force q += 1").contains("V\nforce q += 1\n\n# trailing"));
        assert_eq!(place_of(NOTEBOOK, FORCE), None);
        assert_eq!(place_of(NOTEBOOK, ""), None);
    }

    #[test]
    fn neighbours_and_comments_stay_when_a_statement_goes() {
        let of = |text: &str, n: usize| {
            find(text, |_| true).get(n).map(|s| s.site.0).unwrap_or_default()
        };
        for (text, n, expected) in [
            ("a; b", 9, "a; b"),
            ("T = p; V = q # c\n", 0, "V = q # c\n"),
            ("T = p; V = q # c\n", 1, "T = p # c\n"),
            ("T = p # c\nV = q\n", 0, "# c\nV = q\n"),
            ("T = p\nV = q", 1, "T = p\n"),
        ] {
            if n < 9 {
                assert_eq!(remove(text, of(text, n)), expected);
            } else {
                assert_eq!(remove(text, Span::new(90, 99)), expected);
            }
        }
    }

    #[test]
    fn a_named_term_goes_with_its_comma_and_comments_stay() {
        for (text, name, expected) in [
            ("V = span{ a: q^2, b: q^4, q }\n", "a", "V = span{ b: q^4, q }\n"),
            ("V = span{ a: q^2, b: q^4 }  # V\n", "b", "V = span{ a: q^2 }  # V\n"),
            ("V = span{ a: q^2 }", "a", "V = span{ }"),
            ("V = q^2 + span{ q^4, a: q }\n", "a", "V = q^2 + span{ q^4 }\n"),
            (
                "V = span{\n    a: q^2,  # first\n    b: q^4,\n    q^3\n}",
                "b",
                "V = span{\n    a: q^2,  # first\n    q^3\n}",
            ),
            (
                "V = span{\n    a: q^2,  # first\n    b: q^4\n}",
                "a",
                "V = span{\n     # first\n    b: q^4\n}",
            ),
            ("T = p\nforce q += span{ drag: -p }\nV = q\n", "drag", "T = p\nV = q\n"),
        ] {
            assert_eq!(remove_term(text, name).as_deref(), Some(expected));
            assert!(spec(expected).1.is_empty(), "{expected}");
        }
        assert_eq!(remove_term("V = span{ a: q^2 }", "b"), None);
        assert_eq!(term_names("V = span{ a: q^2, q }\nforce q += span{ d: -p }"), ["a", "d"]);
    }

    #[test]
    fn a_replaced_part_leaves_the_rest_as_it_was() {
        let statement = find("T = p^2 # known", |_| true).remove(0);
        let StatementKind::Energy { value, .. } = statement.kind else { panic!("an energy") };
        assert_eq!(replace("T = p^2 # known", value.site.0, "p^2/2"), "T = p^2/2 # known");
    }
}
