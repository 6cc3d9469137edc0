//! The server over plain connections: access, limits, runs of which the newest wins, and clients
//! that misbehave.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use stickslip_explore::{Server, Settings, Start};

pub(crate) struct Page {
    server: Server,
    token: String,
}

/// An answer: its status, its head and its body.
pub(crate) struct Answer {
    pub status: u16,
    pub head: String,
    pub body: String,
}

impl Page {
    pub(crate) fn start() -> Page {
        let server = Server::start(Settings::new(Start::Template("blade-couple".into()))).unwrap();
        let token = server.address().split_once("token=").unwrap().1.to_owned();
        Page { server, token }
    }

    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", self.server.port())).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
        stream
    }

    /// Sends a request with these lines of its head; `HOST`, `ORIGIN` and `TOKEN` stand for the
    /// right ones.
    fn send(&self, request: &str, head: &[&str], body: &str) -> TcpStream {
        let own = format!("127.0.0.1:{}", self.server.port());
        let mut text = format!("{request} HTTP/1.1\r\nconnection: close\r\ncontent-length: {}\r\n", body.len());
        for line in head {
            let line = match *line {
                "HOST" => format!("host: {own}"),
                "ORIGIN" => format!("origin: http://{own}"),
                "TOKEN" => format!("x-stickslip-token: {}", self.token),
                other => other.to_owned(),
            };
            text += &format!("{line}\r\n");
        }
        let mut stream = self.connect();
        // the server may refuse before it has read everything
        let _ = stream.write_all(format!("{text}\r\n{body}").as_bytes());
        stream
    }

    pub(crate) fn ask(&self, request: &str, head: &[&str], body: &str) -> Answer {
        read(self.send(request, head, body))
    }

    pub(crate) fn run(&self, body: &Value) -> TcpStream {
        self.send("POST /api/run", &["HOST", "ORIGIN", "TOKEN"], &body.to_string())
    }
}

pub(crate) fn read(mut stream: TcpStream) -> Answer {
    let mut bytes = Vec::new();
    let _ = stream.read_to_end(&mut bytes);
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let (head, body) = text.split_once("\r\n\r\n").unwrap_or((&text, ""));
    let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
    Answer { status, head: head.to_lowercase(), body: body.to_owned() }
}

/// Returns the events of a run: the lines of its body that are objects, between the sizes of chunks.
pub(crate) fn events(answer: &Answer) -> Vec<Value> {
    answer.body.lines().filter(|line| line.starts_with('{')).map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Waits for the first event of a run and returns it with the rest of the answer.
fn first_event(stream: TcpStream) -> (String, BufReader<TcpStream>) {
    let mut lines = BufReader::new(stream);
    let mut line = String::new();
    while !line.starts_with('{') {
        line.clear();
        assert!(lines.read_line(&mut line).unwrap() > 0, "no event");
    }
    (line, lines)
}

pub(crate) fn study(client: &str, points: i64) -> Value {
    json!({
        "client": client, "slot": "study", "study": "template:blade-couple",
        "changes": [{ "path": ["study", "frequency", "points"], "value": { "count": points } }],
        "view": { "kind": "study", "points": null },
    })
}

#[test]
fn the_page_needs_its_token_and_its_host() {
    let page = Page::start();
    let own = format!("GET /?token={}", page.token);
    let answer = page.ask(&own, &["HOST"], "");
    assert_eq!(answer.status, 200);
    assert!(answer.body.contains("<main"), "{}", answer.body);
    for line in [
        "content-security-policy: default-src 'none'; script-src 'self';",
        "x-content-type-options: nosniff",
        "referrer-policy: no-referrer",
        "httponly; samesite=strict",
        "frame-ancestors 'none'",
    ] {
        assert!(answer.head.contains(line), "{line}: {}", answer.head);
    }
    assert!(!answer.head.contains("unsafe-eval") && !answer.head.contains("script-src 'self' 'unsafe-inline'"));
    let status = |request: &str, head: &[&str]| page.ask(request, head, "").status;
    assert_eq!(status("GET /", &["HOST"]), 401);
    assert_eq!(status("GET /?token=0123456789abcdef0123456789abcdef", &["HOST"]), 401);
    assert_eq!(status(&own, &["host: evil.example"]), 421);
    assert_eq!(status(&own, &["HOST", "origin: http://evil.example"]), 403);
    assert_eq!(status("GET /api/catalog", &["HOST"]), 401);
    assert_eq!(status("GET /api/catalog", &["HOST", "TOKEN"]), 200);
    assert_eq!(status("GET /assets/main.js", &["HOST"]), 200);
    assert_eq!(status("GET /assets/main.js", &["host: evil.example"]), 421);
    assert_eq!(status("GET /../Cargo.toml", &["HOST", "TOKEN"]), 404);
    assert_eq!(status("POST /api/run", &["HOST", "TOKEN"]), 403, "a request without an origin");
    assert_eq!(status("POST /api/run", &["HOST", "TOKEN", "origin: null"]), 403);
    assert_eq!(status("DELETE /api/run", &["HOST", "TOKEN", "ORIGIN"]), 405);
}

#[test]
fn a_run_answers_with_its_figure() {
    let page = Page::start();
    let answer = read(page.run(&study("a", 31)));
    assert!(answer.head.contains("application/x-ndjson"), "{}", answer.head);
    let events = events(&answer);
    assert_eq!((&events[0]["event"], &events[0]["points"]), (&json!("begin"), &json!(124)));
    let last = events.last().unwrap();
    assert_eq!((&last["event"], &last["points"]["converged"]), (&json!("result"), &json!(124)));
    assert!(last["plot"]["data"].as_array().unwrap().len() > 4);
}

#[test]
fn errors_of_a_study_name_their_key() {
    let page = Page::start();
    let with = |path: Value, value: Value| {
        let mut request = study("a", 9);
        request["changes"] = json!([{ "path": path, "value": value }]);
        let answer = read(page.run(&request));
        events(&answer).pop().unwrap_or_else(|| panic!("{} {}", answer.status, answer.body))
    };
    let error = with(json!(["parameters", "m"]), json!({ "text": "0.2 N" }));
    assert_eq!(error["event"], "error");
    assert!(error["message"].as_str().unwrap().contains('N') && error["key"].is_string(), "{error}");
    let error = with(json!(["structure", "stiffness"]), json!({ "text": "/etc/passwd" }));
    assert!(error["message"].as_str().unwrap().contains("cannot be changed"), "{error}");
    let mut request = study("a", 9);
    request["study"] = json!("file:/etc/passwd");
    assert!(events(&read(page.run(&request)))[0]["message"].as_str().unwrap().contains("there is no study"));
}

/// A run of 200,000 orbits takes seconds; the next one of the same slot stops it.
#[test]
fn the_newest_run_of_a_slot_wins() {
    let page = Page::start();
    let (first, mut lines) = first_event(page.run(&study("a", 50_000)));
    assert!(first.contains("\"begin\""), "{first}");
    let begun = Instant::now();
    let short = page.run(&study("a", 9));
    let mut rest = String::new();
    lines.read_to_string(&mut rest).unwrap();
    assert!(rest.contains("\"superseded\""), "{rest}");
    assert_eq!(events(&read(short)).last().unwrap()["event"], "result");
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", begun.elapsed());
    // another client is not disturbed
    let other = page.run(&study("b", 2_000));
    assert_eq!(events(&read(page.run(&study("a", 9)))).last().unwrap()["event"], "result");
    assert_eq!(events(&read(other)).last().unwrap()["event"], "result");
}

/// Runs that have lost their slot take no place from others, also while they end.
#[test]
fn many_changes_of_ten_pages_are_all_accepted() {
    let page = Page::start();
    let run = |index: i64, points: i64| first_event(page.run(&study(&format!("page {}", index % 10), points)));
    let older: Vec<_> = (0..50).map(|index| run(index, 20_000)).collect();
    let newest: Vec<_> = (0..10).map(|index| run(index, 9)).collect();
    for (runs, end) in [(older, "superseded"), (newest, "\"result\"")] {
        for (_, mut lines) in runs {
            let mut rest = String::new();
            lines.read_to_string(&mut rest).unwrap();
            assert!(rest.contains(end), "{rest}");
        }
    }
}

/// Runs of clients that are gone end. Otherwise their number would block all others.
#[test]
fn a_client_that_disappears_frees_its_run() {
    let page = Page::start();
    for client in 0..40 {
        let mut stream = page.run(&study(&format!("gone {client}"), 20_000));
        let mut begin = [0; 200];
        let _ = stream.read(&mut begin);
        stream.shutdown(Shutdown::Both).unwrap();
    }
    let end = Instant::now() + Duration::from_secs(60);
    loop {
        let answer = read(page.run(&study("here", 9)));
        if answer.status == 200 {
            assert_eq!(events(&answer).last().unwrap()["event"], "result");
            break;
        }
        assert_eq!(answer.status, 503);
        assert!(Instant::now() < end, "the runs of clients that are gone do not end");
        std::thread::sleep(Duration::from_millis(100));
    }
}

#[test]
fn malformed_and_large_requests_are_refused() {
    let page = Page::start();
    let head = ["HOST", "ORIGIN", "TOKEN"];
    for body in ["", "{", "[]", "{\"study\": 3}", "{\"client\": \"a\"}", "\u{0}", "{\"view\": {\"kind\": \"secret\"}}"]
    {
        assert_eq!(page.ask("POST /api/run", &head, body).status, 400, "{body}");
        assert_eq!(page.ask("POST /api/describe", &head, body).status, 400, "{body}");
    }
    let mut long = study("a", 9);
    long["client"] = json!("x".repeat(1000));
    assert_eq!(page.ask("POST /api/run", &head, &long.to_string()).status, 400);
    let large = page.ask("POST /api/run", &head, &"x".repeat(1 << 20)).status;
    // the server may close the connection before it answers
    assert!([413, 0].contains(&large), "{large}");
    // bytes that are no request
    let mut stream = page.connect();
    stream.write_all(b"\x16\x03\x01 hello\r\n\r\n").unwrap();
    assert_eq!(read(stream).status, 400);
    // a client that sends half a request does not disturb others
    let mut half = page.connect();
    half.write_all(b"POST /api/run HTTP/1.1\r\nhost: ").unwrap();
    assert_eq!(events(&read(page.run(&study("a", 9)))).last().unwrap()["event"], "result");
}

/// A run that takes long sends the results of its finished units, and goes on.
#[test]
fn partial_results_come_before_the_end() {
    let page = Page::start();
    let all = events(&read(page.run(&study("a", 30_000))));
    let partial: Vec<&Value> = all.iter().filter(|event| event["event"] == "partial").collect();
    assert!(!partial.is_empty());
    let counts: Vec<u64> = partial.iter().map(|event| event["points"]["converged"].as_u64().unwrap()).collect();
    assert!(counts.is_sorted() && counts[0] > 0 && *counts.last().unwrap() <= 120_000, "{counts:?}");
    assert!(!partial[0]["plot"]["data"].as_array().unwrap().is_empty());
    assert_eq!(all.last().unwrap()["points"]["converged"], 120_000);
}

/// A page that stays open continues with the next server, if that has the same token.
#[test]
fn a_server_may_take_the_token_of_an_earlier_one() {
    let page = Page::start();
    let settings = Settings { token: Some(page.token.clone()), ..Settings::new(Start::Gallery) };
    let other = Page { server: Server::start(settings).unwrap(), token: page.token.clone() };
    assert_eq!(other.ask("GET /api/catalog", &["HOST", "TOKEN"], "").status, 200);
    let short = Settings { token: Some("1234".into()), ..Settings::new(Start::Gallery) };
    assert!(Server::start(short).unwrap_err().to_string().contains("32 characters"));
}

/// Clients that never read their answers do not hold their connections for ever.
#[test]
fn clients_that_do_not_read_are_disconnected() {
    let page = Page::start();
    // more than the server has connections; the answers do not fit into the buffers of the system
    let silent: Vec<TcpStream> = (0..100).map(|_| page.send("GET /assets/plotly.js", &["HOST"], "")).collect();
    let answer = page.ask("GET /api/catalog", &["HOST", "TOKEN"], "");
    assert_eq!(answer.status, 200);
    drop(silent);
}

#[test]
fn a_long_study_waits() {
    let page = Page::start();
    let mut request = study("a", 100_000);
    request["wait"] = json!(true);
    let answer = events(&read(page.run(&request)));
    assert_eq!(answer[0]["event"], "expect");
    assert!(answer[0]["text"].as_str().unwrap().contains("on one thread"), "{}", answer[0]);
}

/// The expected time is processor time: programs that keep the machine busy do not lengthen it.
#[test]
fn a_short_study_starts_at_once_on_a_busy_machine() {
    let page = Page::start();
    let mut request = study("a", 241);
    request["wait"] = json!(true);
    let ended = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..4 * std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while !ended.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let events: Vec<_> = (0..20).map(|_| first_event(page.run(&request)).0).collect();
        ended.store(true, Ordering::Relaxed);
        assert!(events.iter().all(|event| event.contains("begin")), "{events:?}");
    });
}

#[test]
fn a_study_is_described_with_its_changes() {
    let page = Page::start();
    let request = json!({ "study": "template:blade-couple", "changes": [{ "path": ["study", "vary", "Ft"], "value": "remove" }] });
    let answer = page.ask("POST /api/describe", &["HOST", "ORIGIN", "TOKEN"], &request.to_string());
    let described: Value = serde_json::from_str(&answer.body).unwrap();
    assert_eq!((&described["kind"], described["cases"].as_array().unwrap().len()), (&json!("response"), 1));
    assert_eq!(described["model"]["masses"].as_array().unwrap().len(), 3);
    let frequency = &described["frequency"];
    assert!((frequency["from"].as_f64().unwrap() - 119.5).abs() < 1e-9, "{frequency}");
}

#[test]
fn a_taken_port_is_an_error() {
    let page = Page::start();
    let settings = Settings { port: page.server.port(), ..Settings::new(Start::Gallery) };
    let error = Server::start(settings).unwrap_err().to_string();
    assert!(error.contains("--port") && error.contains(&page.server.port().to_string()), "{error}");
}
