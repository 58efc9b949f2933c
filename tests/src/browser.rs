//! A browser under test: chromedriver on a free port, headless Chromium with a profile of its own, and waiting for what
//! a user would see.

use std::fmt::Debug;
use std::io::{BufRead, BufReader, Write};
use std::net::{Ipv4Addr, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use fantoccini::elements::Element;
use fantoccini::wd::WebDriverCompatibleCommand;
use fantoccini::{Client, ClientBuilder, Locator};
use hyper_util::client::legacy::connect::HttpConnector;
use reqwest::{Method, Url};
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::time::{Instant, sleep};

/// Longest wait for anything that a page shows. Renders that a test waits for take a few seconds on an idle machine.
const TIMEOUT: Duration = Duration::from_secs(240);

const GLANCE: Duration = Duration::from_millis(50);

/// Longest wait for a browser that was asked to end: chromedriver itself waits ten seconds for it before it kills it.
const FAREWELL: Duration = Duration::from_secs(30);

/// As a container's root runs it: no sandbox, no graphics processor, and no calls home.
const CHROMIUM_ARGUMENTS: [&str; 9] = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
];

/// A browser with one page. It ends with the value.
pub struct Browser {
    client: Client,
    _driver: Chromedriver,
    _profile: TempDir,
}

/// A chromedriver, which ends with the value, and its browsers with it.
struct Chromedriver {
    process: Child,
    port: u16,
}

impl Browser {
    /// Starts a browser and opens a page.
    ///
    /// # Panics
    ///
    /// When there is no chromedriver, or it has no Chromium of its version.
    pub async fn open(address: &str) -> Self {
        let profile = tempfile::tempdir().expect("a temporary folder");
        let driver = start_chromedriver();
        let mut arguments: Vec<String> = CHROMIUM_ARGUMENTS.map(str::to_owned).into();
        arguments.push(format!("--user-data-dir={}", profile.path().display()));
        arguments.push("--window-size=1280,1400".to_owned());
        let capabilities = json!({
            "goog:chromeOptions": { "args": arguments },
            "goog:loggingPrefs": { "browser": "ALL" },
        });
        let client = ClientBuilder::new(HttpConnector::new())
            .capabilities(capabilities.as_object().expect("an object").clone())
            .connect(&format!("http://127.0.0.1:{}", driver.port))
            .await
            .expect("chromedriver opens a Chromium of its own version");
        let browser = Self { client, _driver: driver, _profile: profile };
        browser.client.goto(address).await.expect("the page opens");
        browser
    }

    /// Waits until there is an element whose text has `text`; a selector that matches several finds the first such.
    ///
    /// # Panics
    ///
    /// When that takes too long; the message has what the page shows instead.
    #[track_caller]
    pub fn shows<'a>(&'a self, selector: &'a str, text: &'a str) -> impl Future<Output = Element> + 'a {
        let what = format!("an element `{selector}` with the text `{text}`");
        self.until(what, async move || {
            for element in self.client.find_all(Locator::Css(selector)).await.ok()? {
                // An element may leave the page between the two calls.
                if element.text().await.is_ok_and(|found| found.contains(text)) {
                    return Some(element);
                }
            }
            None
        })
    }

    /// Waits until the script returns something that is not null, and returns it.
    ///
    /// # Panics
    ///
    /// When that takes too long.
    #[track_caller]
    pub fn script_gives<'a>(&'a self, script: &'a str) -> impl Future<Output = Value> + 'a {
        let what = format!("a value of `{script}`");
        self.until(what, async move || Some(self.script(script).await).filter(|value| !value.is_null()))
    }

    /// Runs a script in the page.
    ///
    /// # Panics
    ///
    /// When the script fails.
    pub async fn script(&self, script: &str) -> Value {
        self.client.execute(script, Vec::new()).await.expect("the script runs")
    }

    /// Clicks on the first element whose text has `text`, when it is there.
    ///
    /// # Panics
    ///
    /// When it does not appear, or cannot be clicked on.
    pub async fn click(&self, selector: &str, text: &str) {
        self.shows(selector, text).await.click().await.expect("it can be clicked on");
    }

    /// Types into a field, in place of what it has.
    ///
    /// # Panics
    ///
    /// When there is no such field.
    pub async fn fill(&self, selector: &str, text: &str) {
        let field = self.shows(selector, "").await;
        field.clear().await.expect("a field");
        field.send_keys(text).await.expect("a field");
    }

    /// Text of the first element.
    ///
    /// # Panics
    ///
    /// When there is none.
    pub async fn text(&self, selector: &str) -> String {
        self.shows(selector, "").await.text().await.expect("the element is on the page")
    }

    /// What the browser complained about since it was last asked: errors of scripts, of loading, of the content
    /// security policy.
    ///
    /// # Panics
    ///
    /// When chromedriver does not tell.
    pub async fn complaints(&self) -> Vec<String> {
        let log = self.client.issue_cmd(BrowserLog).await.expect("chromedriver keeps the log");
        let entries = log.as_array().expect("a list").iter();
        entries.filter(|entry| entry["level"] == "SEVERE").map(|entry| entry["message"].to_string()).collect()
    }

    /// Waits until `look` finds something.
    #[track_caller]
    fn until<T>(&self, what: String, mut look: impl AsyncFnMut() -> Option<T>) -> impl Future<Output = T> {
        let caller = std::panic::Location::caller();
        async move {
            let deadline = Instant::now() + TIMEOUT;
            loop {
                if let Some(found) = look().await {
                    return found;
                }
                if Instant::now() >= deadline {
                    let page = self.script("return document.body.innerText").await;
                    panic!("at {caller}: the page did not show {what} within {TIMEOUT:?}; it shows:\n{page}");
                }
                sleep(GLANCE).await;
            }
        }
    }
}

impl Drop for Chromedriver {
    fn drop(&mut self) {
        // Ended by a signal, chromedriver leaves its Chromium running, which writes to its profile on and on.
        let asked = TcpStream::connect((Ipv4Addr::LOCALHOST, self.port)).and_then(|mut driver| {
            driver.write_all(b"GET /shutdown HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        });
        let deadline = Instant::now() + FAREWELL;
        while asked.is_ok() && Instant::now() < deadline && matches!(self.process.try_wait(), Ok(None)) {
            std::thread::sleep(GLANCE);
        }
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Starts chromedriver on a port that is free.
fn start_chromedriver() -> Chromedriver {
    let mut process = Command::new("chromedriver")
        .arg("--port=0")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap_or_else(|error| {
            panic!("chromedriver cannot be started ({error}): install Debian's `chromium` and `chromium-driver`")
        });
    let mut lines = BufReader::new(process.stdout.take().expect("its output is piped")).lines().map_while(Result::ok);
    let port = lines.find_map(|line| {
        let (_, port) = line.split_once("was started successfully on port ")?;
        port.trim_end_matches('.').parse().ok()
    });
    // No reader follows: chromedriver writes no more than this to standard output.
    Chromedriver { process, port: port.expect("chromedriver says on which port it listens") }
}

/// Chromedriver's own command for the browser's console.
#[derive(Debug)]
struct BrowserLog;

impl WebDriverCompatibleCommand for BrowserLog {
    fn endpoint(&self, base: &Url, session: Option<&str>) -> Result<Url, <Url as std::str::FromStr>::Err> {
        base.join(&format!("session/{}/se/log", session.unwrap_or_default()))
    }

    fn method_and_body(&self, _: &Url) -> (Method, Option<String>) {
        (Method::POST, Some(json!({ "type": "browser" }).to_string()))
    }
}
