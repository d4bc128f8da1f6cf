//! The head of an HTTP request: what is asked for, and of whom.

use super::connections::LONGEST_HEAD;

/// What a client asks for.
#[derive(Debug, PartialEq)]
pub(super) enum Request {
    Get {
        path: String,
    },
    /// Answered like GET, but without the body.
    Head {
        path: String,
    },
    /// It names another host, or none.
    Foreign,
    Other,
}

impl Request {
    /// Reads a head, which ends with an empty line or with the connection.
    pub(super) fn parse(head: &[u8]) -> Self {
        let text = String::from_utf8_lossy(head);
        let mut lines = text.lines();
        let mut words = lines.next().unwrap_or_default().split(' ');
        let (method, target) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        if !matches!(method, "GET" | "HEAD") || !target.starts_with('/') {
            return Self::Other;
        }
        let fields = lines.take_while(|line| !line.is_empty()).filter_map(|line| line.split_once(':'));
        let mut hosts =
            fields.filter(|(name, _)| name.eq_ignore_ascii_case("host")).map(|(_, host)| host.trim()).peekable();
        if hosts.peek().is_none() || !hosts.all(is_this_machine) {
            return Self::Foreign;
        }
        let path = target.split(['?', '#']).next().unwrap_or_default().to_owned();
        if method == "HEAD" { Self::Head { path } } else { Self::Get { path } }
    }
}

fn is_this_machine(host: &str) -> bool {
    let name = host.rsplit_once(':').map_or(host, |(name, _)| name);
    matches!(name, "127.0.0.1" | "localhost")
}

/// Where a head ends in `bytes`, whose first `known` have no end of one. [`None`] while more must come.
pub(super) fn end_of_head(bytes: &[u8], known: usize) -> Option<usize> {
    // An end may lie across the border.
    let from = known.saturating_sub(3);
    let new = &bytes[from..];
    let end = |mark: &[u8]| new.windows(mark.len()).position(|window| window == mark).map(|at| from + at + mark.len());
    [end(b"\r\n\r\n"), end(b"\n\n")].into_iter().flatten().min().filter(|&end| end <= LONGEST_HEAD)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_read_and_foreign_hosts_refused() {
        let parse = |text: &str| Request::parse(text.as_bytes());
        let get = |path: &str| Request::Get { path: path.to_owned() };
        assert_eq!(parse("GET /scene.l4gs?version=3 HTTP/1.1\r\nHost: 127.0.0.1:4000\r\n\r\n"), get("/scene.l4gs"));
        assert_eq!(parse("GET / HTTP/1.1\r\nhost:localhost\r\n\r\n"), get("/"));
        for foreign in ["evil.example:4000", "127.0.0.1.evil.example", "localhost\r\nHost: evil.example", ""] {
            assert_eq!(parse(&format!("GET / HTTP/1.1\r\nHost: {foreign}\r\n\r\n")), Request::Foreign);
        }
        assert_eq!(parse("GET / HTTP/1.1\r\n\r\nHost: localhost"), Request::Foreign);
        for other in ["POST / HTTP/1.1\r\n\r\n", "", "\r\n", "GET", "GET http://x/ HTTP/1.1\r\n\r\n"] {
            assert_eq!(parse(other), Request::Other);
        }
        assert_eq!(Request::parse(&[0xff, 0xfe, b'\n']), Request::Other);
    }

    #[test]
    fn a_head_ends_with_an_empty_line_however_it_comes() {
        let text = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\nbody";
        let end = text.len() - 4;
        assert!((0..end).all(|known| end_of_head(&text[..end - 1], known.min(end - 1)).is_none()));
        assert!((0..end).all(|known| end_of_head(text, known) == Some(end)));
        assert_eq!(end_of_head(b"GET /\n\n", 0), Some(7));
        assert_eq!(end_of_head(&[vec![b' '; LONGEST_HEAD], b"\n\n".to_vec()].concat(), 0), None);
    }
}
