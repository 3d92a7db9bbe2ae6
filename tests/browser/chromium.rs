//! A headless Chromium, driven over its DevTools protocol: what a test needs of it and no more.

use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::LazyLock;
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;
use tungstenite::{Message, WebSocket};

/// Names under which it is found. Debian has the first two; the first draws no window and takes two thirds of the time.
const NAMES: [&str; 4] = ["chromium-headless-shell", "chromium", "chromium-browser", "google-chrome"];
/// Longest wait for something on the page. The machine may be busy.
const PATIENCE: Duration = Duration::from_mins(3);
/// Between two looks.
const LOOK: Duration = Duration::from_millis(15);

/// Starts the program that it is given, and ends it, with what it left behind, when whoever started this is gone.
const KEEPER: &str = r#""$@" & read -r _; kill $!; wait; rm -rf "$TMPDIR""#;

/// The browser of all tests: starting one takes longer than most of them.
struct Browser {
    address: String,
    /// Its open end is what keeps the browser.
    _keeper: Child,
}

/// A page in a context of its own: nothing of another test is in it. It ends with the test.
pub struct Page {
    socket: WebSocket<TcpStream>,
    session: String,
    context: String,
    last: u64,
    complaints: Vec<String>,
    /// Where downloads land.
    pub downloads: TempDir,
}

/// The path of the program, if it is installed. With `CI=true` it must be.
pub fn found() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    let found =
        NAMES.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name))).find(|file| file.is_file());
    if found.is_none() {
        assert!(std::env::var("CI").as_deref() != Ok("true"), "chromium is not installed");
        eprintln!("NOT CHECKED: chromium is not here");
    }
    found
}

impl Browser {
    fn start() -> Option<Self> {
        let program = found()?;
        let profile = tempfile::tempdir().unwrap().keep();
        let mut keeper = Command::new("sh")
            .args(["-c", KEEPER, "sh"])
            .arg(program)
            .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars"])
            .args(["--force-color-profile=srgb", "--lang=en", "--remote-debugging-port=0", "--no-first-run"])
            .args(["--disable-renderer-backgrounding", "--disable-backgrounding-occluded-windows"])
            .arg(format!("--user-data-dir={}", profile.display()))
            .arg("about:blank")
            .env("TMPDIR", profile)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(keeper.stderr.take().unwrap()).lines();
        let address =
            lines.by_ref().map_while(Result::ok).find_map(|line| Some(line.split_once("listening on ")?.1.to_owned()));
        let address = address.expect("chromium says where it listens");
        // Whatever else it says must not fill the pipe.
        thread::spawn(move || lines.for_each(drop));
        Some(Self { address, _keeper: keeper })
    }
}

/// The parameters that evaluate an expression; a promise is waited for.
fn evaluated(expression: &str) -> Value {
    json!({"expression": expression, "awaitPromise": true, "returnByValue": true})
}

impl Page {
    /// A fresh page; `None` where there is no browser.
    pub fn new() -> Option<Self> {
        static BROWSER: LazyLock<Option<Browser>> = LazyLock::new(Browser::start);
        let address = BROWSER.as_ref()?.address.as_str();
        let downloads = tempfile::tempdir().unwrap();
        let host = address.trim_start_matches("ws://").split('/').next().unwrap();
        let stream = TcpStream::connect(host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let (socket, _) = tungstenite::client(address, stream).unwrap();
        let (session, context) = (String::new(), String::new());
        let mut page = Self { socket, session, context, last: 0, complaints: Vec::new(), downloads };
        let context = page.call("Target.createBrowserContext", json!({}))["browserContextId"].take();
        context.as_str().unwrap().clone_into(&mut page.context);
        let target = page.call("Target.createTarget", json!({"url": "about:blank", "browserContextId": context}));
        let attached = page.call("Target.attachToTarget", json!({"targetId": target["targetId"], "flatten": true}));
        let folder = page.downloads.path().to_str().unwrap().to_owned();
        let to = json!({"behavior": "allow", "downloadPath": folder, "browserContextId": context});
        page.call("Browser.setDownloadBehavior", to);
        attached["sessionId"].as_str().unwrap().clone_into(&mut page.session);
        for domain in ["Page", "Runtime", "Log"] {
            page.call(&format!("{domain}.enable"), json!({}));
        }
        page.call("Emulation.setFocusEmulationEnabled", json!({"enabled": true}));
        // A page computes while one types only where answers come at once; here they always do, by its clock.
        page.call("Page.addScriptToEvaluateOnNewDocument", json!({"source": "performance.now = () => 0;"}));
        page.screen(1440, 900, false);
        Some(page)
    }

    /// Sends a command and waits for its answer. What the page complains of meanwhile is kept.
    pub fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.asked(method, parameters).unwrap_or_else(|error| panic!("{method}: {error}"))
    }

    /// The same, or what the browser has against it.
    fn asked(&mut self, method: &str, parameters: Value) -> Result<Value, Value> {
        self.last += 1;
        let id = self.last;
        let mut command = json!({"id": id, "method": method, "params": parameters});
        if !self.session.is_empty() {
            command["sessionId"] = self.session.as_str().into();
        }
        self.socket.send(Message::text(command.to_string())).unwrap();
        loop {
            let Message::Text(text) = self.socket.read().unwrap() else { continue };
            let mut message: Value = serde_json::from_str(&text).unwrap();
            if message["id"] == id {
                return match message.get_mut("error") {
                    Some(error) => Err(error.take()),
                    None => Ok(message["result"].take()),
                };
            }
            self.note(&message);
        }
    }

    fn note(&mut self, message: &Value) {
        let said = match message["method"].as_str() {
            Some("Runtime.exceptionThrown") => &message["params"]["exceptionDetails"],
            Some("Log.entryAdded") if message["params"]["entry"]["level"] == "error" => &message["params"]["entry"],
            Some("Runtime.consoleAPICalled") if message["params"]["type"] == "error" => &message["params"]["args"],
            _ => return,
        };
        // Refusals of the service are no faults of the page.
        if said["source"] != "network" {
            self.complaints.push(said.to_string());
        }
    }

    /// Fails if the page threw, logged an error or broke its content policy.
    pub fn assert_calm(&mut self) {
        self.evaluate("0");
        assert!(self.complaints.is_empty(), "{:#?}", self.complaints);
        let trouble = self.text("#trouble");
        assert!(trouble.is_empty() || self.evaluate("document.getElementById('trouble').hidden") == true, "{trouble}");
    }

    /// The value of an expression; a promise is waited for.
    pub fn evaluate(&mut self, expression: &str) -> Value {
        let mut answer = self.call("Runtime.evaluate", evaluated(expression));
        assert!(answer.get("exceptionDetails").is_none(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].take()
    }

    /// Waits until an expression is true.
    pub fn until(&mut self, expression: &str) {
        let start = Instant::now();
        while !self.holds(expression) {
            let main = || "document.querySelector('main')?.innerText.slice(0, 2000)";
            assert!(start.elapsed() < PATIENCE, "never came true: {expression}\n{}", self.evaluate(main()));
            thread::sleep(LOOK);
        }
    }

    /// Whether an expression is true; not while the page is being replaced.
    fn holds(&mut self, expression: &str) -> bool {
        let guarded = format!("(() => {{ try {{ return Boolean({expression}) }} catch {{ return false }} }})()");
        match self.asked("Runtime.evaluate", evaluated(&guarded)) {
            Ok(answer) => answer["result"]["value"] == true,
            Err(error) => {
                let said = error["message"].as_str().unwrap_or_default();
                assert!(said.contains("navigated or closed"), "{expression}: {error}");
                false
            }
        }
    }

    /// Waits for an element.
    pub fn wait_for(&mut self, selector: &str) {
        self.until(&format!("document.querySelector({})", json!(selector)));
    }

    /// Opens an address as if typed: the page is loaded anew.
    pub fn open(&mut self, url: &str) {
        self.call("Page.navigate", json!({"url": "about:blank"}));
        self.until("location.href === 'about:blank'");
        self.call("Page.navigate", json!({"url": url}));
        self.until("location.href !== 'about:blank' && document.querySelector('header.shell')");
    }

    /// Size of the window and colour scheme.
    pub fn screen(&mut self, width: u32, height: u32, dark: bool) {
        let mobile = width < 500;
        self.call(
            "Emulation.setDeviceMetricsOverride",
            json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": mobile}),
        );
        let scheme = if dark { "dark" } else { "light" };
        let features = json!([{"name": "prefers-color-scheme", "value": scheme}, {"name": "prefers-reduced-motion", "value": "reduce"}]);
        self.call("Emulation.setEmulatedMedia", json!({"features": features}));
    }

    /// Text of the first element that fits; empty where there is none.
    pub fn text(&mut self, selector: &str) -> String {
        let text = self.evaluate(&format!("document.querySelector({})?.textContent ?? ''", json!(selector)));
        text.as_str().unwrap_or_default().to_owned()
    }

    /// Value of a field.
    pub fn value(&mut self, selector: &str) -> String {
        let value = self.evaluate(&format!("document.querySelector({}).value", json!(selector)));
        value.as_str().unwrap_or_default().to_owned()
    }

    /// Middle of an element, px, after bringing it into sight. What shows itself only after a moment is waited for.
    pub fn middle(&mut self, selector: &str) -> (f64, f64) {
        self.until(&format!(
            "document.querySelector({}).checkVisibility({{visibilityProperty: true}})",
            json!(selector)
        ));
        let found = self.evaluate(&format!(
            "(() => {{ const it = document.querySelector({}); it.scrollIntoView({{block: 'center'}}); \
             const box = it.getBoundingClientRect(); return [box.x + box.width / 2, box.y + box.height / 2] }})()",
            json!(selector)
        ));
        (found[0].as_f64().unwrap(), found[1].as_f64().unwrap())
    }

    /// Moves the mouse.
    pub fn point(&mut self, (x, y): (f64, f64)) {
        self.mouse("mouseMoved", (x, y), 0);
    }

    fn mouse(&mut self, kind: &str, (x, y): (f64, f64), buttons: u8) {
        let button = if kind == "mouseMoved" && buttons == 0 { "none" } else { "left" };
        self.call(
            "Input.dispatchMouseEvent",
            json!({"type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1}),
        );
    }

    /// Presses and moves and lets go.
    pub fn drag(&mut self, from: (f64, f64), to: (f64, f64)) {
        self.point(from);
        self.press_at(from);
        for step in 1..=8 {
            let share = f64::from(step) / 8.0;
            self.pull((from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1)));
        }
        self.let_go(to);
    }

    /// Presses the button of the mouse.
    pub fn press_at(&mut self, place: (f64, f64)) {
        self.mouse("mousePressed", place, 1);
    }

    /// Moves the mouse with its button pressed.
    pub fn pull(&mut self, place: (f64, f64)) {
        self.mouse("mouseMoved", place, 1);
    }

    /// Lets the button of the mouse go.
    pub fn let_go(&mut self, place: (f64, f64)) {
        self.mouse("mouseReleased", place, 0);
    }

    /// A real click in the middle of an element, once it holds still: what has just come may still push it aside.
    pub fn click(&mut self, selector: &str) {
        let start = Instant::now();
        let at = format!("JSON.stringify(document.querySelector({})?.getBoundingClientRect())", json!(selector));
        loop {
            self.middle(selector);
            let before = self.evaluate(&at);
            self.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done())))");
            if self.evaluate(&at) == before {
                break;
            }
            assert!(start.elapsed() < PATIENCE, "{selector} never holds still");
        }
        let place = self.middle(selector);
        self.point(place);
        self.mouse("mousePressed", place, 1);
        self.mouse("mouseReleased", place, 0);
    }

    /// A click on the button or link whose text begins so.
    pub fn click_on(&mut self, text: &str) {
        let mark = format!(
            "(() => {{ for (const it of document.querySelectorAll('button, a, label.button')) \
             if (it.textContent.trim().startsWith({}) && it.checkVisibility()) {{ \
             document.querySelectorAll('[data-click]').forEach(old => old.removeAttribute('data-click')); \
             it.dataset.click = ''; return true }} return false }})()",
            json!(text)
        );
        self.until(&mark);
        self.click("[data-click]");
    }

    /// Types into a field in place of what is there.
    pub fn fill(&mut self, selector: &str, text: &str) {
        self.wait_for(selector);
        self.evaluate(&format!(
            "document.querySelector({}).focus(), document.querySelector({0}).select()",
            json!(selector)
        ));
        // The field selects all of itself a moment after it gets the focus.
        thread::sleep(Duration::from_millis(20));
        self.call("Input.insertText", json!({"text": text}));
    }

    /// Picks an option of a list by its value.
    pub fn pick(&mut self, selector: &str, value: &str) {
        self.wait_for(selector);
        self.evaluate(&format!(
            "(() => {{ const it = document.querySelector({}); it.value = {}; it.dispatchEvent(new Event('change', {{bubbles: true}})) }})()",
            json!(selector),
            json!(value)
        ));
    }

    /// Chooses a file as a person does: a field that has it already says nothing.
    pub fn choose_file(&mut self, selector: &str, file: &std::path::Path) {
        self.wait_for(selector);
        let found = self
            .call("Runtime.evaluate", json!({"expression": format!("document.querySelector({})", json!(selector))}));
        let field = &found["result"]["objectId"];
        self.call("DOM.setFileInputFiles", json!({"files": [file.to_str().unwrap()], "objectId": field}));
    }

    /// Presses a key.
    pub fn press(&mut self, key: &str) {
        let code = match key {
            "Tab" => 9,
            "Enter" => 13,
            "Escape" => 27,
            "End" => 35,
            "Home" => 36,
            "ArrowLeft" => 37,
            "ArrowUp" => 38,
            "ArrowRight" => 39,
            "ArrowDown" => 40,
            _ => 0,
        };
        let text = match key {
            "Enter" => "\r",
            key if key.chars().count() == 1 => key,
            _ => "",
        };
        let kind = if text.is_empty() { "rawKeyDown" } else { "keyDown" };
        let down = json!({"type": kind, "key": key, "text": text, "windowsVirtualKeyCode": code});
        self.call("Input.dispatchKeyEvent", down);
        self.call("Input.dispatchKeyEvent", json!({"type": "keyUp", "key": key, "windowsVirtualKeyCode": code}));
    }

    /// The window as PNG.
    pub fn picture(&mut self) -> Vec<u8> {
        let shot = self.call("Page.captureScreenshot", json!({"format": "png", "optimizeForSpeed": false}));
        decoded(shot["data"].as_str().unwrap())
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        let end =
            json!({"id": 0, "method": "Target.disposeBrowserContext", "params": {"browserContextId": self.context}});
        let _ = self.socket.send(Message::text(end.to_string()));
    }
}

/// Base64 without line breaks.
fn decoded(text: &str) -> Vec<u8> {
    let digit = |byte: u8| match byte {
        b'A'..=b'Z' => byte - b'A',
        b'a'..=b'z' => byte - b'a' + 26,
        b'0'..=b'9' => byte - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    for group in text.as_bytes().chunks(4) {
        let given: Vec<u8> = group.iter().copied().filter(|byte| *byte != b'=').collect();
        let word =
            given.iter().fold(0_u32, |word, byte| (word << 6) | u32::from(digit(*byte))) << (6 * (4 - given.len()));
        bytes.extend_from_slice(&word.to_be_bytes()[1..given.len()]);
    }
    bytes
}
