//! Edits a spec as text, so that every comment and blank line stays.

use super::ast::{Statement, StatementKind};
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
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    let head = &before[line_start..];
    let line_end = after.find('\n').unwrap_or(after.len());
    let tail = &after[..line_end];
    if head.trim().is_empty() && tail.trim().is_empty() {
        let rest = after.get(line_end + 1..).unwrap_or("");
        return format!("{}{rest}", &before[..line_start]);
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
    fn a_replaced_part_leaves_the_rest_as_it_was() {
        let statement = find("T = p^2 # known", |_| true).remove(0);
        let StatementKind::Energy { value, .. } = statement.kind else { panic!("an energy") };
        assert_eq!(replace("T = p^2 # known", value.site.0, "p^2/2"), "T = p^2/2 # known");
    }
}
