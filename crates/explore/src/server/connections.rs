//! Accepts connections on the loopback address and limits them.
//!
//! A client that sends its request or reads its answer slowly is disconnected, and the number
//! of connections is bounded: the server serves one person, or a few windows of one person.

use super::routes::{State, answer};
use super::timed_stream::TimedStream;
use axum::body::Body;
use axum::http::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use std::convert::Infallible;
use std::net::TcpListener;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{Semaphore, oneshot};

/// Limits of connections.
#[derive(Debug, Clone, Copy)]
struct ConnectionSettings {
    /// Largest number of open connections. Default 96: ten clients with six connections each,
    /// which is what a browser opens, and some that wait.
    connections: usize,
    /// Time in which the head of a request must arrive. Default 10 s.
    head: Duration,
    /// Time after which a client that does not read its answer is disconnected. Default 20 s:
    /// a page in the background may pause for some seconds.
    write: Duration,
}

impl Default for ConnectionSettings {
    fn default() -> Self {
        ConnectionSettings { connections: 96, head: Duration::from_secs(10), write: Duration::from_secs(20) }
    }
}

/// Serves until `ended` gets a message or its sender is dropped.
pub(crate) fn serve(listener: TcpListener, state: Arc<State>, ended: oneshot::Receiver<()>) {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let Ok(runtime) = runtime else { return };
    runtime.block_on(async {
        let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
        tokio::select! {
            () = accept(listener, &state) => {}
            _ = ended => {}
        }
    });
    state.stop();
    // a run ends after its current orbit; its result is not needed
    runtime.shutdown_background();
}

async fn accept(listener: tokio::net::TcpListener, state: &Arc<State>) {
    let settings = ConnectionSettings::default();
    let places = Arc::new(Semaphore::new(settings.connections));
    loop {
        // the sender of the semaphore is never closed
        let Ok(place) = places.clone().acquire_owned().await else { return };
        let Ok((stream, _)) = listener.accept().await else {
            // the process has too many open files; wait until some are closed
            tokio::time::sleep(Duration::from_millis(50)).await;
            continue;
        };
        let _ = stream.set_nodelay(true);
        let state = state.clone();
        tokio::spawn(async move {
            let service = service_fn(|request: Request<Incoming>| {
                let state = state.clone();
                async move { Ok::<_, Infallible>(answer(state, request.map(Body::new)).await) }
            });
            let connection = http1::Builder::new()
                .timer(TokioTimer::new())
                .header_read_timeout(settings.head)
                .serve_connection(TokioIo::new(TimedStream::new(stream, settings.write)), service);
            // a client that disappears is no error of the server
            let _ = connection.await;
            drop(place);
        });
    }
}
