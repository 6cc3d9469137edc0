//! Who may use the server.
//!
//! The server listens on the loopback address. Other pages in the same browser could still send
//! requests to it. Three checks stop them: `Host` must be an address of this server, which stops
//! names that point to 127.0.0.1 (DNS rebinding). `Origin` of a request that changes something
//! must be this server. And every answer with data needs the token of the printed address, as a
//! cookie, as a header or in the address.

use axum::http::{HeaderMap, Method, StatusCode, Uri, header};
use std::fmt::Write;

/// The pages that may contain the page in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Embedding {
    /// None.
    Never,
    /// Pages of servers on this machine, such as notebooks.
    LocalPages,
}

/// The checks of requests.
#[derive(Debug)]
pub(crate) struct Access {
    token: String,
    port: u16,
    embedding: Embedding,
}

/// Name of the header with the token, for frames, in which browsers block cookies.
const TOKEN_HEADER: &str = "x-stickslip-token";

impl Access {
    /// Draws a token for the server on this port.
    pub fn new(port: u16, embedding: Embedding) -> Result<Access, String> {
        let mut bytes = [0u8; 16];
        getrandom::fill(&mut bytes).map_err(|error| format!("no random numbers: {error}"))?;
        let token = bytes.iter().fold(String::new(), |mut token, byte| {
            let _ = write!(token, "{byte:02x}");
            token
        });
        Ok(Access { token, port, embedding })
    }

    /// Takes the token of an earlier server.
    pub fn with_token(port: u16, embedding: Embedding, token: String) -> Access {
        Access { token, port, embedding }
    }

    /// Returns the address of the page.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/?token={}", self.port, self.token)
    }

    /// Returns the value of `Set-Cookie`. The name contains the port, because cookies do not
    /// distinguish ports.
    pub fn cookie(&self) -> String {
        format!("stickslip_{}={}; HttpOnly; SameSite=Strict; Path=/", self.port, self.token)
    }

    /// Returns the policy that allows the page nothing from elsewhere. Styles may stand in
    /// elements, because plotly.js writes them.
    pub fn policy(&self) -> String {
        let ancestors = match self.embedding {
            Embedding::Never => "'none'".to_owned(),
            Embedding::LocalPages => "http://localhost:* http://127.0.0.1:*".to_owned(),
        };
        format!(
            "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; \
             connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors {ancestors}"
        )
    }

    /// Checks a request, except for its token.
    ///
    /// # Errors
    /// The status and a sentence of the refusal.
    pub fn check_origin(&self, method: &Method, headers: &HeaderMap) -> Result<(), Refusal> {
        let text = |name: header::HeaderName| headers.get(name).and_then(|value| value.to_str().ok());
        let own = [format!("127.0.0.1:{}", self.port), format!("localhost:{}", self.port)];
        if !text(header::HOST).is_some_and(|host| own.iter().any(|own| own == host)) {
            return Err(Refusal {
                status: StatusCode::MISDIRECTED_REQUEST,
                reason: "this server answers 127.0.0.1 only",
            });
        }
        let own_origin = |origin: &str| own.iter().any(|own| origin.strip_prefix("http://") == Some(own));
        let origin = text(header::ORIGIN);
        let foreign = match (origin, method == Method::GET) {
            (Some(origin), _) => !own_origin(origin),
            (None, get) => !get,
        };
        if foreign {
            return Err(Refusal { status: StatusCode::FORBIDDEN, reason: "this server answers its own page only" });
        }
        Ok(())
    }

    /// Checks the token of a request.
    ///
    /// # Errors
    /// The status and a sentence of the refusal.
    pub fn check_token(&self, uri: &Uri, headers: &HeaderMap) -> Result<(), Refusal> {
        let in_address =
            uri.query().into_iter().flat_map(|query| query.split('&')).find_map(|pair| pair.strip_prefix("token="));
        let name = format!("stickslip_{}=", self.port);
        let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
        let mut in_cookies = cookies.flat_map(|all| all.split(';')).filter_map(|pair| pair.trim().strip_prefix(&name));
        let in_header = headers.get(TOKEN_HEADER).and_then(|value| value.to_str().ok());
        if [in_address, in_header].into_iter().flatten().any(|token| self.is_token(token))
            || in_cookies.any(|token| self.is_token(token))
        {
            return Ok(());
        }
        Err(Refusal {
            status: StatusCode::UNAUTHORIZED,
            reason: "the token is missing or wrong: open the address that `stickslip explore` printed",
        })
    }

    /// Compares in a time that does not depend on the number of equal characters.
    fn is_token(&self, text: &str) -> bool {
        text.len() == self.token.len() && text.bytes().zip(self.token.bytes()).fold(0, |all, (a, b)| all | (a ^ b)) == 0
    }
}

/// A refused request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Refusal {
    pub status: StatusCode,
    pub reason: &'static str,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(&'static str, String)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap())).collect()
    }

    fn access() -> Access {
        Access::new(4711, Embedding::Never).unwrap()
    }

    #[test]
    fn only_this_server_is_a_host() {
        let access = access();
        let check = |host: &str| access.check_origin(&Method::GET, &headers(&[("host", host.to_owned())]));
        assert!(check("127.0.0.1:4711").is_ok() && check("localhost:4711").is_ok());
        for host in ["evil.example:4711", "127.0.0.1:4712", "127.0.0.1", "127.0.0.1:4711.evil.example", ""] {
            assert!(check(host).is_err(), "{host}");
        }
        assert!(access.check_origin(&Method::GET, &HeaderMap::new()).is_err());
    }

    #[test]
    fn only_the_page_itself_sends_requests() {
        let access = access();
        let host = ("host", "127.0.0.1:4711".to_owned());
        let check = |method: Method, origin: Option<&str>| {
            let origin = origin.map(|origin| ("origin", origin.to_owned()));
            access.check_origin(&method, &headers(&[host.clone()].into_iter().chain(origin).collect::<Vec<_>>()))
        };
        assert!(check(Method::POST, Some("http://127.0.0.1:4711")).is_ok());
        assert!(check(Method::GET, None).is_ok());
        for origin in [Some("http://evil.example"), Some("null"), Some("https://127.0.0.1:4711"), None] {
            assert!(check(Method::POST, origin).is_err(), "{origin:?}");
        }
        assert!(check(Method::GET, Some("http://evil.example")).is_err());
    }

    #[test]
    fn the_token_is_wanted() {
        let access = access();
        let token = access.address().split_once("token=").unwrap().1.to_owned();
        let check =
            |uri: &str, pairs: &[(&'static str, String)]| access.check_token(&uri.parse().unwrap(), &headers(pairs));
        assert_eq!(token.len(), 32);
        assert!(check(&format!("/?a=b&token={token}"), &[]).is_ok());
        assert!(check("/", &[("cookie", format!("a=b; stickslip_4711={token}"))]).is_ok());
        assert!(check("/", &[(TOKEN_HEADER, token.clone())]).is_ok());
        for (uri, pairs) in [
            ("/", vec![]),
            ("/?token=", vec![]),
            ("/?token=00000000000000000000000000000000", vec![]),
            ("/", vec![("cookie", format!("stickslip_4712={token}"))]),
            ("/", vec![(TOKEN_HEADER, token[..31].to_owned())]),
        ] {
            assert!(check(uri, &pairs).is_err(), "{uri} {pairs:?}");
        }
        assert_ne!(access.address(), self::access().address());
    }
}
