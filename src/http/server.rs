//! Connections: accepted, bounded, and closed in good order.

use std::convert::Infallible;
use std::future::poll_fn;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::{Body, HttpBody as _};
use axum::http::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, mpsc, watch};
use tower::Service;

use super::in_place::in_place;
use super::{App, Peer, body};
use crate::config::seconds;

/// How long a refused client may go on sending before its connection is cut, and how long it may pause meanwhile.
const LINGER: Duration = Duration::from_secs(30);
const LINGER_PAUSE: Duration = Duration::from_secs(2);
/// Pause after the system had no descriptor to spare.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);
/// How often samples of latency are folded.
const UPKEEP: Duration = Duration::from_secs(5);

/// Serves until `stop` says so, then lets requests in work finish for `grace`; what is left of it. Until they have,
/// newcomers are answered, too: that the service is shutting down.
pub async fn serve(listener: TcpListener, app: App, mut stop: watch::Receiver<bool>, grace: Duration) -> Duration {
    let router = super::router(&app);
    let places = Arc::new(Semaphore::new(app.limits.connections));
    let header_timeout = seconds(app.limits.header_timeout_s);
    // Closed when the last connection has dropped its end.
    let (open, mut all_closed) = mpsc::channel::<Infallible>(1);
    let upkeep = tokio::spawn(upkeep(app.clone()));
    loop {
        let accepted = tokio::select! {
            biased;
            _ = stop.wait_for(|stop| *stop) => break,
            accepted = accept(&listener, &places) => accepted,
        };
        let Some((stream, peer, place)) = accepted else { continue };
        let (router, stop, open) = (router.clone(), stop.clone(), open.clone());
        tokio::spawn(in_place(async move {
            connection(stream, peer, router, header_timeout, Some(stop)).await;
            drop((place, open));
        }));
    }
    app.stop();
    drop(open);
    let end = Instant::now() + grace;
    let drained = tokio::time::timeout(grace, all_closed.recv());
    tokio::pin!(drained);
    loop {
        tokio::select! {
            biased;
            closed = &mut drained => {
                if closed.is_err() {
                    tracing::warn!("requests in work did not finish in time and were cut off");
                }
                break;
            }
            accepted = accept(&listener, &places) => {
                let Some((stream, peer, place)) = accepted else { continue };
                let router = router.clone();
                tokio::spawn(in_place(async move {
                    connection(stream, peer, router, header_timeout, None).await;
                    drop(place);
                }));
            }
        }
    }
    upkeep.abort();
    end.saturating_duration_since(Instant::now())
}

async fn accept(
    listener: &TcpListener,
    places: &Arc<Semaphore>,
) -> Option<(TcpStream, SocketAddr, tokio::sync::OwnedSemaphorePermit)> {
    let place = places.clone().acquire_owned().await.ok()?;
    match listener.accept().await {
        Ok((stream, peer)) => Some((stream, peer, place)),
        Err(error) => {
            // Connections that are gone again are nothing; running out of descriptors passes.
            tracing::warn!(%error, "a connection could not be accepted");
            tokio::time::sleep(ACCEPT_PAUSE).await;
            None
        }
    }
}

/// Serves one connection; without `stop` just one request of it.
async fn connection(
    stream: TcpStream,
    address: SocketAddr,
    router: Router,
    header_timeout: Duration,
    mut stop: Option<watch::Receiver<bool>>,
) {
    // Answers leave in one write: waiting for more to fill a packet only delays them.
    let _ = stream.set_nodelay(true);
    let unread = body::Unread::default();
    let peer = Peer { ip: address.ip(), unread: unread.clone() };
    let service = service_fn(move |request: Request<Incoming>| {
        let mut request = request.map(Body::new);
        peer.unread.store(!request.body().is_end_stream(), Ordering::Relaxed);
        request.extensions_mut().insert(peer.clone());
        router.clone().call(request)
    });
    let mut connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(header_timeout)
        .keep_alive(stop.is_some())
        .serve_connection(TokioIo::new(stream), service);
    let outcome = loop {
        let stopping = async {
            match &mut stop {
                // The sender outlives the server; were it gone, that would mean stop as well.
                Some(stop) => drop(stop.wait_for(|stop| *stop).await),
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            outcome = poll_fn(|context| connection.poll_without_shutdown(context)) => break outcome,
            () = stopping => {
                std::pin::Pin::new(&mut connection).graceful_shutdown();
                stop = None;
            }
        }
    };
    if let Err(error) = outcome {
        tracing::debug!(%error, %address, "connection");
    }
    let mut stream = connection.into_parts().io.into_inner();
    if unread.load(Ordering::Relaxed) {
        body::linger(&mut stream, LINGER_PAUSE, LINGER).await;
    }
}

async fn upkeep(app: App) {
    let mut tick = tokio::time::interval(UPKEEP);
    loop {
        tick.tick().await;
        app.metrics.upkeep();
    }
}
