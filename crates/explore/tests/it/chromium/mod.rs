//! Chromium by its DevTools protocol: JSON messages that end with a zero byte, over two named
//! pipes, which the shell gives to Chromium as files 3 and 4.

use serde_json::{Value, json};
use std::collections::VecDeque;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Variable with the folder of the pictures.
pub const SCREENSHOTS: &str = "STICKSLIP_SCREENSHOTS";

/// Names of the program.
const NAMES: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// A browser with one page.
pub struct Browser {
    process: Child,
    send: File,
    receive: BufReader<File>,
    events: VecDeque<Value>,
    session: String,
    next: u64,
    /// The profile and the pipes.
    _folder: tempfile::TempDir,
}

impl Browser {
    /// Starts Chromium; `None` if it is not installed.
    pub fn start() -> Option<Browser> {
        let Some(program) = find() else {
            eprintln!("skipped: Chromium is not installed (Debian: apt-get install chromium)");
            return None;
        };
        let folder = tempfile::tempdir().unwrap();
        let [to, from] = ["to", "from"].map(|name| folder.path().join(name));
        for pipe in [&to, &from] {
            assert!(Command::new("mkfifo").arg(pipe).status().unwrap().success());
        }
        let script = "exec \"$0\" --headless=new --no-sandbox --disable-gpu --enable-unsafe-swiftshader --no-first-run --remote-debugging-pipe \
                      --user-data-dir=\"$1\" about:blank 3<\"$2\" 4>\"$3\"";
        let process = Command::new("sh")
            .args(["-c", script])
            .arg(program)
            .arg(folder.path().join("profile"))
            .args([&to, &from])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // the shell opens the pipes in this order, and each waits for its other end
        let send = OpenOptions::new().write(true).open(&to).unwrap();
        let receive = BufReader::new(File::open(&from).unwrap());
        let mut browser = Browser {
            process,
            send,
            receive,
            events: VecDeque::new(),
            session: String::new(),
            next: 1,
            _folder: folder,
        };
        let target = browser.call("Target.createTarget", json!({ "url": "about:blank" }))["targetId"].clone();
        let attached = browser.call("Target.attachToTarget", json!({ "targetId": target, "flatten": true }));
        browser.session = attached["sessionId"].as_str().unwrap().to_owned();
        for domain in ["Page", "Runtime", "Log", "Network"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        browser.size(1400, 900);
        Some(browser)
    }

    fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.try_call(method, parameters).unwrap_or_else(|error| panic!("{method}: {error}"))
    }

    fn try_call(&mut self, method: &str, parameters: Value) -> Result<Value, Value> {
        let id = self.next;
        self.next += 1;
        let mut message = json!({ "id": id, "method": method, "params": parameters });
        if !self.session.is_empty() {
            message["sessionId"] = json!(self.session);
        }
        self.send.write_all(format!("{message}\0").as_bytes()).unwrap();
        loop {
            let mut bytes = Vec::new();
            assert!(self.receive.read_until(0, &mut bytes).unwrap() > 0, "Chromium ended during {method}");
            bytes.pop();
            let message: Value = serde_json::from_slice(&bytes).unwrap();
            if message["id"] == id {
                let error = &message["error"];
                return if error.is_null() { Ok(message["result"].clone()) } else { Err(error.clone()) };
            }
            self.events.push_back(message);
        }
    }

    pub fn go(&mut self, address: &str) {
        self.call("Page.navigate", json!({ "url": address }));
    }

    pub fn hide_scrollbars(&mut self) {
        self.call("Emulation.setScrollbarsHidden", json!({ "hidden": true }));
    }

    pub fn forget_cookies(&mut self) {
        self.call("Network.clearBrowserCookies", json!({}));
    }

    pub fn size(&mut self, width: u32, height: u32) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", size);
    }

    pub fn dark(&mut self, dark: bool) {
        let value = if dark { "dark" } else { "light" };
        let features = json!({ "features": [{ "name": "prefers-color-scheme", "value": value }] });
        self.call("Emulation.setEmulatedMedia", features);
    }

    /// Returns the value of an expression, of statements, or of a promise.
    pub fn evaluate(&mut self, script: &str) -> Value {
        self.try_evaluate(script).unwrap_or_else(|error| panic!("{script}: {error}"))
    }

    /// Returns an error of Chromium if the page is loaded again meanwhile.
    fn try_evaluate(&mut self, script: &str) -> Result<Value, Value> {
        let parameters = json!({ "expression": script, "awaitPromise": true, "returnByValue": true, "replMode": true });
        let result = self.try_call("Runtime.evaluate", parameters)?;
        assert!(result["exceptionDetails"].is_null(), "{script}: {}", result["exceptionDetails"]);
        Ok(result["result"]["value"].clone())
    }

    /// Returns the value of a promise that is kept within 30 s.
    pub fn awaited(&mut self, promise: &str) -> Value {
        self.evaluate(&format!(
            "await Promise.race([{promise}, new Promise((_, fail) => setTimeout(() => fail(new Error('too slow')), 30000))])"
        ))
    }

    /// Returns the memory of the page in use after its garbage was collected, bytes.
    pub fn heap(&mut self) -> f64 {
        self.call("HeapProfiler.collectGarbage", json!({}));
        self.call("Performance.enable", json!({}));
        let metrics = self.call("Performance.getMetrics", json!({}))["metrics"].clone();
        let used = metrics.as_array().into_iter().flatten().find(|one| one["name"] == "JSHeapUsedSize");
        used.and_then(|one| one["value"].as_f64()).unwrap()
    }

    pub fn number(&mut self, script: &str) -> f64 {
        self.evaluate(script).as_f64().unwrap_or_else(|| panic!("{script} is no number"))
    }

    pub fn text(&mut self, script: &str) -> String {
        self.evaluate(script).as_str().unwrap_or_else(|| panic!("{script} is no text")).to_owned()
    }

    /// Waits until a condition holds.
    pub fn wait(&mut self, condition: &str) {
        self.wait_for(condition, Duration::from_secs(30));
    }

    /// Waits until a condition holds, for computations of many orbits on a busy machine.
    pub fn wait_long(&mut self, condition: &str) {
        self.wait_for(condition, Duration::from_secs(180));
    }

    /// A page that is just loaded again does not fulfil the condition yet.
    fn wait_for(&mut self, condition: &str, time: Duration) {
        let end = Instant::now() + time;
        while self.try_evaluate(&format!("Boolean({condition})")) != Ok(Value::Bool(true)) {
            let state = "document.getElementById('message')?.textContent + ' | ' + document.getElementById('panels')?.innerText?.slice(0, 400)";
            if Instant::now() > end {
                panic!("not after {time:?}: {condition}; the page: {}; {:?}", self.evaluate(state), self.problems());
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    fn mouse(&mut self, kind: &str, [x, y]: [f64; 2], pressed: bool) {
        let count = u32::from(kind != "mouseMoved");
        let event = json!({ "type": kind, "x": x, "y": y, "button": "left", "buttons": u32::from(pressed), "clickCount": count });
        self.call("Input.dispatchMouseEvent", event);
    }

    pub fn click(&mut self, x: f64, y: f64) {
        self.mouse("mouseMoved", [x, y], false);
        // plotly.js needs a frame to see what is below the pointer
        std::thread::sleep(Duration::from_millis(200));
        self.mouse("mousePressed", [x, y], true);
        self.mouse("mouseReleased", [x, y], false);
    }

    pub fn drag(&mut self, from: [f64; 2], to: [f64; 2]) {
        self.mouse("mouseMoved", from, false);
        self.mouse("mousePressed", from, true);
        for part in [0.25, 0.5, 0.75, 1.0] {
            self.mouse("mouseMoved", [0, 1].map(|i| from[i] + part * (to[i] - from[i])), true);
        }
        std::thread::sleep(Duration::from_millis(100));
        self.mouse("mouseReleased", to, false);
    }

    pub fn key(&mut self, name: &str) {
        let code = json!({ "ArrowRight": 39, "ArrowLeft": 37, "Escape": 27, "Tab": 9 })[name].clone();
        for kind in ["rawKeyDown", "keyUp"] {
            let event = json!({ "type": kind, "key": name, "code": name, "windowsVirtualKeyCode": code });
            self.call("Input.dispatchKeyEvent", event);
        }
    }

    /// Forgets the events so far. While a slider moves they take 20 kB a request.
    pub fn forget_events(&mut self) {
        self.events.clear();
    }

    /// Returns errors of scripts and refusals of the policy.
    pub fn problems(&mut self) -> Vec<String> {
        let is = |event: &&Value| {
            event["method"] == "Runtime.exceptionThrown"
                || event["method"] == "Log.entryAdded" && event["params"]["entry"]["level"] == "error"
        };
        self.events.iter().filter(is).map(|event| event["params"].to_string()).collect()
    }

    /// Asserts that no script failed and nothing was refused.
    pub fn check_clean(&mut self) {
        self.evaluate("1");
        let problems = self.problems();
        assert!(problems.is_empty(), "{problems:?}");
    }

    /// Returns the addresses of all requests.
    pub fn requests(&mut self) -> Vec<String> {
        self.evaluate("1");
        let sent = self.events.iter().filter(|event| event["method"] == "Network.requestWillBeSent");
        sent.filter_map(|event| event["params"]["request"]["url"].as_str().map(str::to_owned)).collect()
    }

    /// Writes a picture of the page if a folder was given.
    pub fn picture(&mut self, name: &str) {
        let Some(folder) = std::env::var_os(SCREENSHOTS) else { return };
        std::thread::sleep(Duration::from_millis(600));
        let shot = self.call("Page.captureScreenshot", json!({ "format": "png" }));
        let bytes = from_base64(shot["data"].as_str().unwrap());
        std::fs::write(Path::new(&folder).join(format!("{name}.png")), bytes).unwrap();
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn find() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path)
        .flat_map(|folder| NAMES.map(|name| folder.join(name)))
        .find(|program| program.is_file())
}

/// Decodes base 64 (RFC 4648).
fn from_base64(text: &str) -> Vec<u8> {
    const DIGITS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let values: Vec<u32> =
        text.bytes().filter_map(|byte| DIGITS.iter().position(|digit| *digit == byte)).map(|v| v as u32).collect();
    let of = |chunk: &[u32]| {
        let bits = chunk.iter().fold(0, |bits, value| bits << 6 | value) << (6 * (4 - chunk.len()));
        bits.to_be_bytes()[1..chunk.len()].to_vec()
    };
    values.chunks(4).flat_map(of).collect()
}
