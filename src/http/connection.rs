//! One connection, from its first byte to its last.

use super::connections::{Busy, Place};
use super::host::Peer;
use super::problem::{Code, Problem};
use super::router::router;
use super::state::AppState;
use super::stream::Stream;
use super::tls::{Tls, TlsError};
use axum::Router;
use axum::body::Body;
use axum::extract::Request;
use axum::response::Response;
use http_body::{Body as HttpBody, Frame, SizeHint};
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::convert::Infallible;
use std::future::Future;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_util::sync::CancellationToken;
use tower::Service;

/// hyper takes no smaller buffer.
const SMALLEST_BUFFER: usize = 8192;
/// How long a connection that is asked to leave may take to hand over what it has answered.
const LEAVE_WITHIN: Duration = Duration::from_secs(1);

/// What all connections share.
pub(super) struct ConnectionServer {
    pub state: AppState,
    router: Router,
    http: http1::Builder,
    tls: Tls,
    /// Ends every connection at once.
    cut: CancellationToken,
}

impl ConnectionServer {
    /// How this service's connections are served.
    ///
    /// # Errors
    /// [`TlsError`] where the certificate cannot be used.
    pub fn new(state: AppState, cut: CancellationToken) -> Result<Self, TlsError> {
        let config = &state.config;
        let mut http = http1::Builder::new();
        http.timer(TokioTimer::new())
            .header_read_timeout(config.header_timeout)
            .max_header_size(config.max_header_bytes)
            .max_buf_size(config.max_header_bytes.max(SMALLEST_BUFFER));
        Ok(Self {
            router: router(state.clone()),
            http,
            tls: Tls::load(config)?,
            cut,
            state,
        })
    }

    /// Whether clients speak TLS.
    pub fn is_encrypted(&self) -> bool {
        self.state.config.tls_cert.is_some()
    }

    /// Serves a connection to its end.
    pub async fn serve(&self, socket: TcpStream, peer: SocketAddr, place: Place) {
        let place = Arc::new(place);
        let served = async {
            match &self.tls {
                Tls::Off => self.requests(Stream::new(socket), peer, &place).await,
                #[cfg(feature = "tls")]
                Tls::On(acceptor) => {
                    let within = self.state.config.header_timeout.max(Duration::from_secs(1));
                    let handshake = tokio::time::timeout(within, acceptor.accept(Stream::new(socket)));
                    tokio::select! {
                        shaken = handshake => {
                            if let Ok(Ok(stream)) = shaken {
                                self.requests(stream, peer, &place).await;
                            }
                        }
                        () = place.asked_to_leave() => {}
                        () = self.state.stopping.cancelled() => {}
                    }
                }
            }
        };
        tokio::select! {
            () = served => {}
            () = self.cut.cancelled() => {}
        }
    }

    async fn requests<S>(&self, stream: S, peer: SocketAddr, place: &Arc<Place>)
    where
        S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
    {
        let requests = Requests {
            router: self.router.clone(),
            place: Arc::clone(place),
            peer,
        };
        let connection = self
            .http
            .serve_connection(TokioIo::new(stream), TowerToHyperService::new(requests));
        tokio::pin!(connection);
        // What a client does wrong is its own matter: it was answered where HTTP has an answer.
        tokio::select! {
            _ = &mut connection => return,
            () = place.asked_to_leave() => {}
            () = self.state.stopping.cancelled() => {}
        }
        connection.as_mut().graceful_shutdown();
        // A request that is being answered is answered; a client that only holds the connection loses it.
        while tokio::time::timeout(LEAVE_WITHIN, &mut connection).await.is_err() {
            if !place.is_busy() {
                return;
            }
        }
    }
}

/// The routes, as one connection sees them.
#[derive(Clone)]
struct Requests {
    router: Router,
    place: Arc<Place>,
    peer: SocketAddr,
}

impl Service<Request<Incoming>> for Requests {
    type Response = Response;
    type Error = Infallible;
    type Future = Pin<Box<dyn Future<Output = Result<Response, Infallible>> + Send>>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, request: Request<Incoming>) -> Self::Future {
        let busy = self.place.begin();
        let mut request = request.map(Body::new);
        request.extensions_mut().insert(Peer(self.peer));
        let answer = self.router.call(request);
        Box::pin(async move { Ok(answer.await?.map(|body| Body::new(Answer { body, _busy: busy }))) })
    }
}

/// An answer's body; while it is being sent its connection is busy.
struct Answer {
    body: Body,
    _busy: Busy,
}

impl HttpBody for Answer {
    type Data = bytes::Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Self::Data>, Self::Error>>> {
        Pin::new(&mut self.body).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// Tells a client that its address has all its connections busy, and closes.
pub(super) async fn turn_away(socket: TcpStream) {
    let problem = Problem::new(
        Code::Overloaded,
        "your address has as many connections with running requests as it may; wait for one, or use fewer",
    )
    .to_json(None)
    .to_string();
    let answer = format!(
        "HTTP/1.1 503 Service Unavailable\r\ncontent-type: application/problem+json\r\nretry-after: 1\r\n\
         connection: close\r\ncontent-length: {}\r\n\r\n{problem}",
        problem.len()
    );
    let mut stream = Stream::new(socket);
    let told = async {
        stream.write_all(answer.as_bytes()).await?;
        stream.shutdown().await
    };
    // A client that does not take it is gone.
    let _ = tokio::time::timeout(LEAVE_WITHIN, told).await;
}
