//! A server for one page on this machine: GET and HEAD, and a few paths.
//!
//! It listens on 127.0.0.1 only, and answers only requests that name this machine as their host. So a page from
//! elsewhere cannot read the scene by a domain name that resolves to this machine.

use std::borrow::Cow;
use std::io::{BufRead, BufReader, Read, Result, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::time::Duration;

/// More than the head of a browser's request takes.
const LONGEST_HEAD: u64 = 32 << 10;
const PATIENCE: Duration = Duration::from_secs(10);

/// The answer for a path.
#[derive(Clone, Debug)]
pub(super) struct Answer {
    /// Such as `text/html; charset=utf-8`.
    pub(super) content_type: &'static str,
    /// The content.
    pub(super) body: Cow<'static, [u8]>,
}

/// A server that is ready to answer.
#[derive(Debug)]
pub(super) struct Server {
    listener: TcpListener,
}

impl Server {
    /// Listens on a port of 127.0.0.1; port 0 is any free one.
    ///
    /// # Errors
    /// A port that is taken or reserved.
    pub(super) fn bind(port: u16) -> Result<Self> {
        Ok(Self { listener: TcpListener::bind((Ipv4Addr::LOCALHOST, port))? })
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
        let respond = Arc::new(respond);
        for stream in self.listener.incoming().flatten() {
            let respond = Arc::clone(&respond);
            // Errors are ignored: a browser that has gone away, or a thread that cannot be started.
            let _ = std::thread::Builder::new().spawn(move || answer(&stream, &*respond));
        }
    }
}

fn answer(mut stream: &TcpStream, respond: &dyn Fn(&str) -> Option<Answer>) -> Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let request = request(stream)?;
    let (status, answer) = match &request {
        Request::Get { path } | Request::Head { path } => match respond(path) {
            Some(answer) => ("200 OK", answer),
            None => ("404 Not Found", text("There is nothing at this address.")),
        },
        Request::Foreign => ("403 Forbidden", text("This server answers to 127.0.0.1 and localhost only.")),
        Request::Other => ("405 Method Not Allowed", text("This server knows GET and HEAD only.")),
    };
    let Answer { content_type, body } = answer;
    let length = body.len();
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: {content_type}\r\nContent-Length: {length}\r\nCache-Control: no-store\r\n\
         X-Content-Type-Options: nosniff\r\nCross-Origin-Resource-Policy: same-origin\r\nConnection: close\r\n\r\n"
    )?;
    if !matches!(request, Request::Head { .. }) {
        stream.write_all(&body)?;
    }
    stream.flush()
}

fn text(body: &'static str) -> Answer {
    Answer { content_type: "text/plain; charset=utf-8", body: Cow::Borrowed(body.as_bytes()) }
}

#[derive(Debug, PartialEq)]
enum Request {
    Get {
        path: String,
    },
    /// Answered like GET, but without the body.
    Head {
        path: String,
    },
    /// It names another host.
    Foreign,
    Other,
}

/// Reads a request up to the empty line.
fn request(stream: impl Read) -> Result<Request> {
    let mut lines = BufReader::new(stream.take(LONGEST_HEAD)).lines();
    let first = lines.next().transpose()?.unwrap_or_default();
    let mut host = None;
    for line in lines {
        let line = line?;
        if line.is_empty() {
            break;
        }
        if let Some((name, value)) = line.split_once(':')
            && name.eq_ignore_ascii_case("host")
        {
            host = Some(value.trim().to_owned());
        }
    }
    let mut words = first.split(' ');
    let (method, target) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    if !matches!(method, "GET" | "HEAD") || !target.starts_with('/') {
        return Ok(Request::Other);
    }
    let name = host.as_deref().map(|host| host.rsplit_once(':').map_or(host, |(name, _)| name));
    if !matches!(name, Some("127.0.0.1" | "localhost")) {
        return Ok(Request::Foreign);
    }
    let path = target.split(['?', '#']).next().unwrap_or_default().to_owned();
    Ok(if method == "HEAD" { Request::Head { path } } else { Request::Get { path } })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_read_and_foreign_hosts_refused() {
        let parse = |text: &str| request(text.as_bytes()).unwrap();
        let get = |path: &str| Request::Get { path: path.to_owned() };
        assert_eq!(parse("GET /scene.l4gs?version=3 HTTP/1.1\r\nHost: 127.0.0.1:4000\r\n\r\n"), get("/scene.l4gs"));
        assert_eq!(parse("GET / HTTP/1.1\r\nhost:localhost\r\n\r\n"), get("/"));
        assert_eq!(parse("GET / HTTP/1.1\r\nHost: evil.example:4000\r\n\r\n"), Request::Foreign);
        assert_eq!(parse("GET / HTTP/1.1\r\nHost: 127.0.0.1.evil.example\r\n\r\n"), Request::Foreign);
        assert_eq!(parse("GET / HTTP/1.1\r\n\r\n"), Request::Foreign);
        for other in ["POST / HTTP/1.1\r\n\r\n", "", "\r\n", "GET", "GET http://x/ HTTP/1.1\r\n\r\n"] {
            assert_eq!(parse(other), Request::Other);
        }
        assert!(request(&[0xff, 0xfe, b'\n'][..]).is_err());
        // A head that does not end is cut off.
        let endless = format!("GET / HTTP/1.1\r\nHost: localhost\r\n{}", "x: y\r\n".repeat(100_000));
        assert_eq!(parse(&endless), get("/"));
    }

    #[test]
    fn a_server_answers_on_this_machine() {
        let server = Server::bind(0).unwrap();
        let address = server.address().unwrap();
        assert!(address.ip().is_loopback() && address.port() != 0);
        std::thread::spawn(move || server.run(|path| (path == "/").then(|| text("hello"))));
        let ask = |method: &str, path: &str| {
            let mut stream = TcpStream::connect(address).unwrap();
            write!(stream, "{method} {path} HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
            let mut answer = String::new();
            stream.read_to_string(&mut answer).unwrap();
            answer
        };
        let answer = ask("GET", "/");
        assert!(answer.starts_with("HTTP/1.1 200 OK\r\n") && answer.ends_with("\r\n\r\nhello"));
        assert_eq!(ask("HEAD", "/") + "hello", answer);
        assert!(ask("GET", "/x").starts_with("HTTP/1.1 404"));
        assert!(ask("POST", "/").starts_with("HTTP/1.1 405"));
    }
}
