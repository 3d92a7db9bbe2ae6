//! Runs the commands of a page as a reader would: in a shell, in an empty folder, against a service of their own.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use tempfile::TempDir;

use super::shown;

/// Where the documentation says that the service listens.
const DOCUMENTED: &str = "127.0.0.1:8080";
const PRECUT: &str = env!("CARGO_BIN_EXE_precut");

/// A shell in a folder of its own, with a service if the page needs one.
pub(crate) struct Console {
    folder: TempDir,
    server: Option<Server>,
    last: Option<String>,
}

struct Server {
    child: Child,
    address: String,
    _data: TempDir,
}

impl Console {
    pub(crate) fn new() -> Self {
        Self { server: Some(Server::start()), ..Self::without_server() }
    }

    pub(crate) fn without_server() -> Self {
        let folder = tempfile::tempdir().unwrap();
        // A pipe is no terminal: curl would draw its progress into what it prints.
        std::fs::write(folder.path().join(".curlrc"), "silent\nshow-error\n").unwrap();
        Self { folder, server: None, last: None }
    }

    /// A file that later commands read.
    pub(crate) fn file(&mut self, name: &str, text: &str) -> Result<(), String> {
        std::fs::write(self.folder.path().join(name), text).map_err(|error| format!("{name}: {error}"))
    }

    /// Commands, each with what it prints; the last may leave that to an answer.
    pub(crate) fn session(&mut self, text: &str) -> Result<(), String> {
        let mut commands: Vec<(String, String)> = Vec::new();
        for line in text.lines() {
            match (line.strip_prefix("$ "), line.strip_prefix("> "), commands.last_mut()) {
                (Some(command), _, _) => commands.push((command.to_owned(), String::new())),
                (None, Some(more), Some((command, printed))) if printed.is_empty() => {
                    command.push('\n');
                    command.push_str(more);
                }
                (None, _, Some((_, printed))) => {
                    printed.push_str(line);
                    printed.push('\n');
                }
                (None, _, None) => return Err("it does not begin with a command after `$ `".to_owned()),
            }
        }
        for (command, printed) in commands {
            self.last = None;
            let output = self.run(&command)?;
            if !printed.is_empty() {
                shown::lines(&printed, &output).map_err(|fault| format!("{command}\n{fault}"))?;
            }
            self.last = Some(output);
        }
        Ok(())
    }

    /// What the last command printed.
    pub(crate) fn answer(&mut self, language: &str, text: &str) -> Result<(), String> {
        let Some(output) = &self.last else { return Err("an answer to no command that ran".to_owned()) };
        if language == "json" { shown::json(text, output) } else { shown::lines(text, output) }
    }

    /// What a command prints that has to succeed.
    pub(crate) fn output(&mut self, command: &str) -> String {
        self.run(command).unwrap_or_else(|fault| panic!("{fault}"))
    }

    fn run(&self, command: &str) -> Result<String, String> {
        let address = self.server.as_ref().map_or(DOCUMENTED, |server| &server.address);
        let beside = Path::new(PRECUT).parent().unwrap().to_str().unwrap();
        let path = format!("{beside}:{}", std::env::var("PATH").unwrap_or_default());
        let output = bare(Command::new("sh"))
            .args(["-c", &format!("exec 2>&1\n{}", command.replace(DOCUMENTED, address))])
            .current_dir(self.folder.path())
            .env("PATH", path)
            .env("CURL_HOME", self.folder.path())
            .env("HOME", self.folder.path())
            .stdin(Stdio::null())
            .output()
            .map_err(|error| format!("{command}: {error}"))?;
        let printed = String::from_utf8(output.stdout).map_err(|error| format!("{command}: {error}"))?;
        if output.status.success() {
            Ok(printed.replace(address, DOCUMENTED))
        } else {
            Err(format!("{command}\nfailed ({}): {printed}", output.status))
        }
    }
}

impl Server {
    /// `precut serve` on a free port, with an empty data folder.
    fn start() -> Self {
        let data = tempfile::tempdir().unwrap();
        let mut child = bare(Command::new(PRECUT))
            .args(["serve", "--listen", "127.0.0.1:0", "--data", data.path().to_str().unwrap()])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let address = lines
            .by_ref()
            .map_while(Result::ok)
            .find_map(|line| line.split_once("listens on http://").map(|(_, address)| address.trim().to_owned()));
        // Whatever else it prints has to go somewhere.
        std::thread::spawn(move || lines.for_each(drop));
        Self { child, address: address.expect("it says where it listens"), _data: data }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A command that the settings of whoever runs the tests do not reach.
fn bare(mut command: Command) -> Command {
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("PRECUT_")) {
        command.env_remove(name);
    }
    command
}
