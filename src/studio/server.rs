//! The server: connections, limits, and nothing about the studio's own matters.

use std::net::{Ipv4Addr, TcpListener};
use std::sync::Arc;
use std::time::Duration;

use http_body_util::{BodyExt, Full, Limited};
use hyper::body::{Bytes, Incoming};
use hyper::header::{CONTENT_TYPE, HeaderName, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::sync::Semaphore;

use super::guard::ALWAYS;
use super::routes::{self, Reply};
use super::{Studio, files, server_error};
use crate::error::{Error, ErrorKind, Result};

/// Connections at a time; more are turned away.
const CONNECTIONS: usize = 256;
/// Threads for answers that take work: checks, exports, reports.
const THREADS: usize = 2;
/// A client that is slower to ask than this is let go.
const PATIENCE: Duration = Duration::from_secs(30);
/// Longest head of a request, in bytes.
const HEAD: usize = 16 << 10;
/// Longest body: a spec as a JSON text, in which a character may take six bytes.
const BODY: usize = 6 * files::LARGEST;

/// Takes a port of this machine that no other machine can reach.
///
/// # Errors
/// The port is taken.
pub(super) fn listen(port: u16) -> Result<TcpListener> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(|error| {
        Error::new(
            ErrorKind::Port,
            format!("port {port} cannot be served: {error}"),
            "choose another port, or none to take one that is free",
        )
    })?;
    listener.set_nonblocking(true).map_err(|error| server_error(&error))?;
    Ok(listener)
}

/// Serves for ever.
pub(super) fn run(listener: TcpListener, studio: Arc<Studio>, ready: impl FnOnce()) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_io()
        .enable_time()
        .max_blocking_threads(THREADS)
        .build()
        .map_err(|error| server_error(&error))?;
    runtime.block_on(async {
        let listener = tokio::net::TcpListener::from_std(listener).map_err(|e| server_error(&e))?;
        let free = Arc::new(Semaphore::new(CONNECTIONS));
        ready();
        loop {
            let Ok((stream, _)) = listener.accept().await else {
                // Out of handles, most likely: some will come back.
                tokio::time::sleep(Duration::from_millis(50)).await;
                continue;
            };
            // Too many: the stream is dropped, which closes it.
            let Ok(place) = Arc::clone(&free).try_acquire_owned() else { continue };
            let studio = Arc::clone(&studio);
            tokio::spawn(async move {
                let service = service_fn(|request| answer(request, &studio));
                let mut connection = http1::Builder::new();
                connection
                    .timer(TokioTimer::new())
                    .header_read_timeout(PATIENCE)
                    .max_buf_size(HEAD);
                // Clients that go away in the middle are no failure.
                let _ = connection.serve_connection(TokioIo::new(stream), service).await;
                drop(place);
            });
        }
    })
}

async fn answer(
    request: Request<Incoming>,
    studio: &Arc<Studio>,
) -> std::result::Result<Response<Full<Bytes>>, std::convert::Infallible> {
    let (head, body) = request.into_parts();
    let route = routes::find(&head.method, head.uri.path());
    let open = route.is_none_or(|route| route.open);
    let refused = studio.guard.check(&head.method, &head.headers, open);
    let answer = match (refused, route) {
        (Err((status, why)), _) => Reply::refused(status, why),
        (Ok(()), None) => Reply::refused(StatusCode::NOT_FOUND, "there is no such page"),
        (Ok(()), Some(route)) => {
            let read = tokio::time::timeout(PATIENCE, Limited::new(body, BODY).collect()).await;
            match read {
                Ok(Ok(body)) => {
                    let query = head.uri.query().unwrap_or("").to_string();
                    route.answer(studio, query, body.to_bytes()).await
                }
                Ok(Err(_)) => Reply::refused(
                    StatusCode::PAYLOAD_TOO_LARGE,
                    "that is too large for a spec: 1 MB is the most",
                ),
                Err(_) => Reply::refused(StatusCode::REQUEST_TIMEOUT, "that took too long"),
            }
        }
    };
    Ok(respond(answer))
}

fn respond(answer: Reply) -> Response<Full<Bytes>> {
    let mut response = Response::new(Full::new(answer.body));
    *response.status_mut() = answer.status;
    let headers = response.headers_mut();
    for (name, value) in ALWAYS {
        headers.insert(HeaderName::from_static(name), HeaderValue::from_static(value));
    }
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(answer.kind));
    if let Some(name) = answer.save_as
        && let Ok(value) = HeaderValue::from_str(&format!("attachment; filename=\"{name}\""))
    {
        headers.insert(hyper::header::CONTENT_DISPOSITION, value);
    }
    response
}
