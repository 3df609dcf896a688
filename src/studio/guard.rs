//! Who may ask what: this machine's own page, and nobody else.
//!
//! A page of another site can send requests to this machine, and a name of another site can be
//! made to point to it. So the host must be this machine's own, whatever changes something must
//! come from this page, and everything but the empty page needs a token that other pages cannot
//! read: it stands in the fragment of the address, which browsers do not send.

use hyper::header::{HOST, HeaderMap, HeaderName, HeaderValue, ORIGIN};
use hyper::{Method, StatusCode};

use crate::error::{Error, ErrorKind, Result};

/// The header in which the page sends its token.
pub(super) const TOKEN: HeaderName = HeaderName::from_static("x-leverrier-token");

/// Headers of every answer: nothing from elsewhere, nothing kept, nothing guessed, no frames.
pub(super) const ALWAYS: &[(&str, &str)] = &[
    (
        "content-security-policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; \
         img-src 'self' data:; form-action 'none'; base-uri 'none'; frame-ancestors 'none'",
    ),
    ("x-content-type-options", "nosniff"),
    ("x-frame-options", "DENY"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-resource-policy", "same-origin"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cache-control", "no-store"),
];

/// What requests are held against.
pub(super) struct Guard {
    hosts: [String; 2],
    token: String,
}

/// Why a request is refused.
pub(super) type Refusal = (StatusCode, &'static str);

impl Guard {
    /// A guard with a new token.
    pub(super) fn new(port: u16) -> Result<Self> {
        let mut bytes = [0; 24];
        getrandom::fill(&mut bytes).map_err(|error| {
            Error::new(
                ErrorKind::System,
                format!("the system has no random numbers: {error}"),
                "start it again",
            )
        })?;
        let token = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Guard { hosts: ["127.0.0.1", "localhost"].map(|name| format!("{name}:{port}")), token })
    }

    pub(super) fn token(&self) -> &str {
        &self.token
    }

    /// Whether a request may pass. `open` are paths that tell nothing of the user's work.
    pub(super) fn check(
        &self,
        method: &Method,
        headers: &HeaderMap,
        open: bool,
    ) -> std::result::Result<(), Refusal> {
        let text = |name: HeaderName| headers.get(name).map(HeaderValue::as_bytes);
        let own = |host: &[u8]| self.hosts.iter().any(|known| known.as_bytes() == host);
        let twice = headers.get_all(HOST).iter().count() != 1;
        if twice || !text(HOST).is_some_and(own) {
            return Err((StatusCode::FORBIDDEN, "the studio answers on 127.0.0.1 only"));
        }
        let changes = *method != Method::GET;
        let page = text(ORIGIN).map(|origin| origin.strip_prefix(b"http://").is_some_and(own));
        if page == Some(false) || changes && page.is_none() {
            return Err((StatusCode::FORBIDDEN, "this does not come from the studio's own page"));
        }
        if open && !changes {
            return Ok(());
        }
        let given = text(TOKEN).unwrap_or(b"");
        if !same(given, self.token.as_bytes()) {
            return Err((
                StatusCode::UNAUTHORIZED,
                "open the address that the studio printed when it was started",
            ));
        }
        Ok(())
    }
}

/// Compares without telling by the time it takes where texts differ.
fn same(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |sum, (a, b)| sum | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(rows: &[(&'static str, &str)]) -> HeaderMap {
        let mut map = HeaderMap::new();
        for (name, value) in rows {
            map.append(*name, HeaderValue::from_str(value).expect("a header"));
        }
        map
    }

    #[test]
    fn only_the_own_page_with_its_token_passes() {
        let guard = Guard::new(8000).expect("random numbers");
        let token = guard.token().to_string();
        let own: &[(&str, &str)] = &[("host", "127.0.0.1:8000")];
        let from = ("origin", "http://localhost:8000");
        let with = ("x-leverrier-token", token.as_str());
        let pass = |method: Method, rows: &[(&'static str, &str)], open: bool| {
            guard.check(&method, &headers(rows), open).is_ok()
        };
        assert!(pass(Method::GET, own, true) && !pass(Method::GET, own, false));
        assert!(pass(Method::GET, &[own[0], with], false));
        assert!(pass(Method::POST, &[own[0], with, from], false));
        assert!(!pass(Method::POST, &[own[0], with], false));
        assert!(!pass(Method::POST, &[own[0], from], true));
        for host in ["evil.example:8000", "127.0.0.1", "127.0.0.1:80001", "localhost:8000.evil"] {
            assert!(!pass(Method::GET, &[("host", host), with], true), "{host}");
        }
        assert!(!pass(Method::GET, &[own[0], own[0], with], false));
        for origin in ["http://evil.example", "null", "https://127.0.0.1:8000", "127.0.0.1:8000"] {
            assert!(!pass(Method::POST, &[own[0], with, ("origin", origin)], false), "{origin}");
        }
        assert!(!pass(Method::GET, &[own[0], ("x-leverrier-token", &token[1..])], false));
    }
}
