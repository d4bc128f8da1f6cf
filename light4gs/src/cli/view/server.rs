//! A server for one page on this machine: GET and HEAD, and a few paths.
//!
//! It listens on 127.0.0.1 only, and answers only requests that name this machine as their host. So a page from
//! elsewhere cannot read the scene by a domain name that resolves to this machine.

use std::io::{Result, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::time::Duration;

use super::connections::{Connection, Connections, NoHead};
use super::request::Request;

/// Before the next attempt, where the system gives no connection: it has no descriptors left.
const PAUSE: Duration = Duration::from_millis(10);

/// The content of an answer. A scene is there once, for all who read it.
#[derive(Clone, Debug)]
pub(super) enum Body {
    Fixed(&'static [u8]),
    Shared(Arc<Vec<u8>>),
}

impl From<&'static str> for Body {
    fn from(text: &'static str) -> Self {
        Self::Fixed(text.as_bytes())
    }
}

impl From<Arc<Vec<u8>>> for Body {
    fn from(bytes: Arc<Vec<u8>>) -> Self {
        Self::Shared(bytes)
    }
}

impl From<String> for Body {
    fn from(text: String) -> Self {
        Self::Shared(Arc::new(text.into_bytes()))
    }
}

impl AsRef<[u8]> for Body {
    fn as_ref(&self) -> &[u8] {
        match self {
            Self::Fixed(bytes) => bytes,
            Self::Shared(bytes) => bytes,
        }
    }
}

/// The answer for a path.
#[derive(Clone, Debug)]
pub(super) struct Answer {
    /// Such as `text/html; charset=utf-8`.
    pub(super) content_type: &'static str,
    pub(super) body: Body,
}

/// A server that is ready to answer.
#[derive(Debug)]
pub(super) struct Server {
    listener: TcpListener,
    /// The content security policy of its pages.
    policy: &'static str,
}

impl Server {
    /// Listens on a port of 127.0.0.1; port 0 is any free one.
    ///
    /// # Errors
    /// A port that is taken or reserved.
    pub(super) fn bind(port: u16, policy: &'static str) -> Result<Self> {
        Ok(Self { listener: TcpListener::bind((Ipv4Addr::LOCALHOST, port))?, policy })
    }

    /// Its address.
    ///
    /// # Errors
    /// What the system refuses.
    pub(super) fn address(&self) -> Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Answers requests until the process ends, each on its own thread. `respond` gets the path without its query.
    pub(super) fn run(&self, respond: impl Fn(&str) -> Option<Answer> + Send + Sync + 'static) {
        let (respond, policy) = (Arc::new(respond), self.policy);
        let connections = Connections::default();
        for stream in self.listener.incoming() {
            let Ok(stream) = stream else {
                connections.send_one_away();
                std::thread::sleep(PAUSE);
                continue;
            };
            match connections.admit(stream) {
                Ok(place) => {
                    let respond = Arc::clone(&respond);
                    // A thread that cannot be started is no reason to end: the client tries again.
                    let _ = std::thread::Builder::new().spawn(move || serve(&place.connection, policy, &*respond));
                }
                Err(stream) => refuse(&stream),
            }
        }
    }
}

/// Answers one request.
fn serve(connection: &Connection, policy: &str, respond: &dyn Fn(&str) -> Option<Answer>) {
    let request = connection.read_head().map(|head| Request::parse(&head));
    let (status, Answer { content_type, body }) = match &request {
        Ok(Request::Get { path } | Request::Head { path }) => match respond(path) {
            Some(answer) => ("200 OK", answer),
            None => ("404 Not Found", text("There is nothing at this address.")),
        },
        Ok(Request::Foreign) => ("403 Forbidden", text("This server answers to 127.0.0.1 and localhost only.")),
        Ok(Request::Other) => ("405 Method Not Allowed", text("This server knows GET and HEAD only.")),
        Err(NoHead::TooLong) => ("431 Request Header Fields Too Large", text("The head of the request is too long.")),
        Err(NoHead::TooLate) => ("408 Request Timeout", text("The head of the request has not come in time.")),
        Err(NoHead::Gone) => return,
    };
    let body = body.as_ref();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {content_type}\r\nContent-Length: {}\r\nCache-Control: no-store\r\n\
         Content-Security-Policy: {policy}\r\nReferrer-Policy: no-referrer\r\nX-Content-Type-Options: nosniff\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\nConnection: close\r\n\r\n",
        body.len()
    );
    let sent = connection.send(head.as_bytes()).and_then(|()| match request {
        Ok(Request::Head { .. }) => Ok(()),
        _ => connection.send(body),
    });
    // The others have gone away.
    if sent.is_ok() {
        connection.end();
    }
}

/// Sends a client away for whom there is no place.
fn refuse(mut stream: &TcpStream) {
    let answer =
        b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 1\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";
    // So few bytes need no waiting, and a client that has gone away needs no answer.
    let _ = stream.set_nonblocking(true).and_then(|()| stream.write_all(answer));
}

fn text(body: &'static str) -> Answer {
    Answer { content_type: "text/plain; charset=utf-8", body: body.into() }
}

#[cfg(test)]
mod tests {
    use std::io::Read;
    use std::time::Instant;

    use super::*;

    /// A server with a few bytes at `/`, and many at `/large`.
    fn started() -> SocketAddr {
        let server = Server::bind(0, "default-src 'none'").unwrap();
        let address = server.address().unwrap();
        assert!(address.ip().is_loopback() && address.port() != 0);
        let large = Arc::new(vec![7; 64 << 20]);
        std::thread::spawn(move || {
            server.run(move |path| match path {
                "/" => Some(text("hello")),
                "/large" => Some(Answer { content_type: "x/y", body: large.clone().into() }),
                _ => None,
            });
        });
        address
    }

    fn send(address: SocketAddr, head: &str) -> TcpStream {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(head.as_bytes()).unwrap();
        stream
    }

    fn ask(address: SocketAddr, head: &str) -> String {
        let mut answer = String::new();
        send(address, head).read_to_string(&mut answer).unwrap();
        answer
    }

    const GET: &str = "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n";

    #[test]
    fn a_server_answers_on_this_machine() {
        let address = started();
        let ask =
            |method: &str, path: &str| ask(address, &format!("{method} {path} HTTP/1.1\r\nHost: localhost\r\n\r\n"));
        let answer = ask("GET", "/");
        assert!(answer.starts_with("HTTP/1.1 200 OK\r\n") && answer.ends_with("\r\n\r\nhello"));
        assert!(answer.contains("\r\nContent-Security-Policy: default-src 'none'\r\n"));
        assert_eq!(ask("HEAD", "/") + "hello", answer);
        assert!(ask("GET", "/x").starts_with("HTTP/1.1 404"));
        assert!(ask("POST", "/").starts_with("HTTP/1.1 405"));
    }

    /// What was not read would reset the connection, and with it the answer.
    #[test]
    fn a_head_that_is_too_long_and_a_body_get_an_answer() {
        let address = started();
        let long = format!("GET / HTTP/1.1\r\nHost: localhost\r\n{}\r\n", "x: y\r\n".repeat(200_000));
        assert!(ask(address, &long).starts_with("HTTP/1.1 431"));
        let body = format!("POST / HTTP/1.1\r\nHost: localhost\r\n\r\n{}", "b".repeat(1 << 20));
        assert!(ask(address, &body).starts_with("HTTP/1.1 405"));
    }

    #[test]
    fn clients_that_send_or_read_slowly_keep_nobody_out() {
        let address = started();
        let halves: Vec<TcpStream> = (0..300).map(|_| send(address, "GET / HTTP/1.1\r\nHost: loc")).collect();
        let begin = Instant::now();
        assert!(ask(address, GET).ends_with("hello"));
        assert!(begin.elapsed() < Duration::from_secs(2), "{:?}", begin.elapsed());
        drop(halves);
        // All of these get bytes, and take none of them.
        let readers: Vec<TcpStream> =
            (0..128).map(|_| send(address, "GET /large HTTP/1.1\r\nHost: localhost\r\n\r\n")).collect();
        for reader in &readers {
            assert_eq!(reader.peek(&mut [0; 8]).unwrap(), 8);
        }
        std::thread::sleep(Duration::from_secs(2));
        assert!(ask(address, GET).ends_with("hello"));
    }
}
