//! Connections: accepted, bounded, and closed in good order.

use std::collections::HashMap;
use std::convert::Infallible;
use std::future::poll_fn;
use std::net::{IpAddr, SocketAddr};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::{Body, HttpBody as _};
use axum::http::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc, watch};
use tower::Service;

use super::gate::Client;
use super::in_place::in_place;
use super::{App, Peer, body, callbacks};
use crate::config::seconds;

/// How long a refused client may go on sending before its connection is cut, and how long it may pause meanwhile.
const LINGER: Duration = Duration::from_secs(30);
const LINGER_PAUSE: Duration = Duration::from_secs(2);
/// Pause after the system had no descriptor to spare.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);
/// How often samples of latency are folded.
const UPKEEP: Duration = Duration::from_secs(5);
/// Connections at the address for health and metrics, and how many of them one client may have.
const ADMIN_CONNECTIONS: usize = 64;
const ADMIN_CONNECTIONS_PER_CLIENT: usize = 32;

/// Serves until `stop` says so, then lets requests in work finish for `grace`; what is left of it. Until they have,
/// newcomers are answered, too: that the service is shutting down. `admin` answers for health and metrics all the time.
pub async fn serve(
    listener: TcpListener,
    admin: Option<TcpListener>,
    app: App,
    mut stop: watch::Receiver<bool>,
    grace: Duration,
) -> Duration {
    let router = super::router(&app);
    let places = Places::new(app.limits.connections, app.limits.connections_per_client);
    let header_timeout = seconds(app.limits.header_timeout_s);
    // Closed when the last connection has dropped its end.
    let (open, mut all_closed) = mpsc::channel::<Infallible>(1);
    let upkeep = tokio::spawn(upkeep(app.clone()));
    let telling = tokio::spawn(callbacks::deliver(app.clone(), stop.clone()));
    let admin = admin.map(|listener| tokio::spawn(serve_admin(listener, app.clone())));
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
    // It ends by itself, soon after it was told to stop.
    let _ = telling.await;
    if let Some(admin) = admin {
        admin.abort();
    }
    end.saturating_duration_since(Instant::now())
}

/// Answers for health and metrics, one request a connection: nobody keeps one for later.
async fn serve_admin(listener: TcpListener, app: App) {
    let router = super::admin_router(&app);
    let places = Places::new(ADMIN_CONNECTIONS, ADMIN_CONNECTIONS_PER_CLIENT);
    let header_timeout = seconds(app.limits.header_timeout_s);
    loop {
        let Some((stream, peer, place)) = accept(&listener, &places).await else { continue };
        let router = router.clone();
        tokio::spawn(async move {
            connection(stream, peer, router, header_timeout, None).await;
            drop(place);
        });
    }
}

/// Places for connections: so many for all, and of them so many for one client that others find one.
#[derive(Clone)]
struct Places {
    free: Arc<Semaphore>,
    of_one: usize,
    taken: Arc<Mutex<HashMap<Client<'static>, Taken>>>,
}

/// What one client has.
#[derive(Default)]
struct Taken {
    places: usize,
    /// Whether it is in the log that it wanted more.
    told: bool,
}

/// The place of one connection, free again when it is dropped.
struct Place {
    places: Places,
    client: Client<'static>,
    _permit: OwnedSemaphorePermit,
}

impl Places {
    fn new(all: usize, of_one: usize) -> Self {
        Self { free: Arc::new(Semaphore::new(all)), of_one, taken: Arc::default() }
    }

    /// `None` where the client has all that one may have.
    fn take(&self, permit: OwnedSemaphorePermit, ip: IpAddr) -> Option<Place> {
        let client = Client::at(ip);
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        let its = taken.entry(client).or_default();
        if its.places < self.of_one {
            its.places += 1;
            return Some(Place { places: self.clone(), client, _permit: permit });
        }
        if !std::mem::replace(&mut its.told, true) {
            tracing::warn!(%ip, connections = its.places, "a client opens too many connections; further ones are closed");
        }
        None
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut taken = self.places.taken.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(its) = taken.get_mut(&self.client) {
            its.places -= 1;
            if its.places == 0 {
                taken.remove(&self.client);
            }
        }
    }
}

async fn accept(listener: &TcpListener, places: &Places) -> Option<(TcpStream, SocketAddr, Place)> {
    let permit = places.free.clone().acquire_owned().await.ok()?;
    match listener.accept().await {
        Ok((stream, peer)) => places.take(permit, peer.ip()).map(|place| (stream, peer, place)),
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
