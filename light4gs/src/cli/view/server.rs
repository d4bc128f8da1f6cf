//! A server for one page on this machine: GET and HEAD, and a few paths.
//!
//! It listens on 127.0.0.1 only, and answers only requests that name this machine as their host. So a page from
//! elsewhere cannot read the scene by a domain name that resolves to this machine.

use std::io::{Result, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::time::Duration;

use super::body::Body;
use super::connections::{Connection, Connections, NoHead};
use super::request::Request;

/// Before the next attempt, where the system gives no connection: it has no descriptors left.
const PAUSE: Duration = Duration::from_millis(10);

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
    let (mut status, Answer { content_type, body }) = match &request {
        Ok(Request::Get { path, .. } | Request::Head { path }) => match respond(path) {
            Some(answer) => ("200 OK", answer),
            None => ("404 Not Found", text("There is nothing at this address.")),
        },
        Ok(Request::Foreign) => ("403 Forbidden", text("This server answers to 127.0.0.1 and localhost only.")),
        Ok(Request::Other) => ("405 Method Not Allowed", text("This server knows GET and HEAD only.")),
        Err(NoHead::TooLong) => ("431 Request Header Fields Too Large", text("The head of the request is too long.")),
        Err(NoHead::TooLate) => ("408 Request Timeout", text("The head of the request has not come in time.")),
        Err(NoHead::Gone) => return,
    };
    let missing = text("The file cannot be read.").body;
    let mut body = body.open().unwrap_or_else(|_| {
        status = "404 Not Found";
        missing.open().expect("a text can be opened")
    });
    let whole = 0..body.len();
    let mut sent = whole.clone();
    let mut range = String::new();
    if let (Ok(Request::Get { range: Some(asked), .. }), "200 OK") = (&request, status) {
        match asked.within(body.len()) {
            Some(part) => {
                status = "206 Partial Content";
                range = format!("Content-Range: bytes {}-{}/{}\r\n", part.start, part.end - 1, body.len());
                sent = part;
            }
            None => {
                status = "416 Range Not Satisfiable";
                range = format!("Content-Range: bytes */{}\r\n", body.len());
                sent = 0..0;
            }
        }
    }
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {content_type}\r\nContent-Length: {}\r\n{range}Accept-Ranges: bytes\r\n\
         Cache-Control: no-store\r\n\
         Content-Security-Policy: {policy}\r\nReferrer-Policy: no-referrer\r\nX-Content-Type-Options: nosniff\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\nConnection: close\r\n\r\n",
        sent.end - sent.start
    );
    let sent = connection.send(head.as_bytes()).and_then(|()| match request {
        Ok(Request::Head { .. }) => Ok(()),
        _ => body.send(sent, connection),
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
    fn ranges_of_bytes_and_of_files_are_sent_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("take.l4gs");
        std::fs::write(&path, (0..200_000_u32).map(|byte| byte as u8).collect::<Vec<_>>()).unwrap();
        let server = Server::bind(0, "default-src 'none'").unwrap();
        let address = server.address().unwrap();
        let body = Body::File(path.as_path().into());
        std::thread::spawn(move || {
            server.run(move |path| match path {
                "/text" => Some(text("hello")),
                "/file" => Some(Answer { content_type: "x/y", body: body.clone() }),
                "/gone" => Some(Answer { content_type: "x/y", body: Body::File(std::path::Path::new("/gone").into()) }),
                _ => None,
            });
        });
        let ask = |path: &str, range: &str| {
            let head = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nRange: {range}\r\n\r\n");
            let mut answer = Vec::new();
            send(address, &head).read_to_end(&mut answer).unwrap();
            let end = answer.windows(4).position(|mark| mark == b"\r\n\r\n").unwrap() + 4;
            (String::from_utf8(answer[..end].to_vec()).unwrap(), answer[end..].to_vec())
        };
        let (head, body) = ask("/text", "bytes=1-3");
        assert!(head.starts_with("HTTP/1.1 206") && head.contains("Content-Range: bytes 1-3/5\r\n"), "{head}");
        assert_eq!(body, b"ell");
        let (head, body) = ask("/file", "bytes=100000-");
        assert!(head.contains("Content-Range: bytes 100000-199999/200000\r\n"), "{head}");
        assert!(body.len() == 100_000 && body.iter().zip(100_000_u32..).all(|(found, byte)| *found == byte as u8));
        assert_eq!(ask("/file", "bytes=-2").1, [199_998_u32 as u8, 199_999_u32 as u8]);
        assert!(ask("/file", "bytes=200000-").0.starts_with("HTTP/1.1 416"));
        // What is no single range is answered with the whole.
        for other in ["bytes=3-1", "bytes=0-1,4-5", "lines=1-2", "bytes=-", "bytes=x-"] {
            let (head, body) = ask("/text", other);
            assert!(head.starts_with("HTTP/1.1 200") && body == b"hello", "{other}: {head}");
        }
        assert!(ask("/gone", "bytes=0-").0.starts_with("HTTP/1.1 404"));
    }

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
