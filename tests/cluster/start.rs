//! What a start says where there is nothing to start with.

use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::database::{Database, Member, until};
use crate::support::toy_command;

/// What a start that does not come about says, on both of its outputs.
pub(crate) fn refused(store: &str, settings: &[(&str, &str)], arguments: &[&str]) -> (Option<i32>, String) {
    let data = tempfile::tempdir().unwrap();
    let mut all = vec!["serve", "--listen", "127.0.0.1:0", "--data", data.path().to_str().unwrap()];
    all.extend_from_slice(arguments);
    let mut command = toy_command(&all);
    command.env("PRECUT_LOG_LEVEL", "trace").env("PRECUT_POSTGRES_WAIT_S", "1").env("PRECUT_STORE", store);
    let output = command.envs(settings.iter().copied()).stdin(Stdio::null()).output().unwrap();
    let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    (output.status.code(), said)
}

#[tokio::test]
async fn a_database_that_is_absent_is_waited_for_and_then_given_up_with_the_reason() {
    let Some(mut database) = Database::start() else { return };
    database.stop("fast");
    let begun = Instant::now();
    let (code, said) = refused(&database.address, &[], &[]);
    assert_eq!(code, Some(1), "{said}");
    assert!(begun.elapsed() >= Duration::from_secs(1) && said.contains("does not answer"), "{said}");
    assert!(!said.contains("loopback"), "the password: {said}");
    // One that comes up in time is taken.
    let address = database.address.clone();
    let data = tempfile::tempdir().unwrap();
    let folder = data.path().to_str().unwrap().to_owned();
    let mut child = toy_command(&["serve", "--listen", "127.0.0.1:0", "--data", &folder])
        .env("PRECUT_STORE", &address)
        .env("PRECUT_POSTGRES_WAIT_S", "60")
        .spawn()
        .unwrap();
    tokio::time::sleep(Duration::from_millis(700)).await;
    database.run_again();
    let serves = tokio::task::spawn_blocking(move || {
        let address = crate::support::address_of(&mut child);
        (child, address)
    });
    let (mut child, address) = serves.await.unwrap();
    let client = crate::database::client();
    until("readiness", async || {
        let response = client.get(format!("http://{address}/health/ready")).send().await.ok()?;
        (response.status() == 200).then_some(())
    })
    .await;
    child.kill().unwrap();
    child.wait().unwrap();
}

#[tokio::test]
async fn what_is_wrong_with_the_store_is_said_without_its_credentials() {
    let Some(database) = Database::start() else { return };
    let wrong = database.address_with("precut:loopback@", "anna:pa55w0rd@");
    for (store, words) in [
        (wrong.as_str(), "does not accept the user name or the password"),
        (&database.address_with("/postgres", "/absent"), "has no database of that name"),
        ("postgrs://anna:pa55w0rd@127.0.0.1/x", "must be \"sqlite\" or an address"),
        ("postgres://anna:pa55w0rd@127.0.0.1:x/x", "is not understood"),
    ] {
        let (code, said) = refused(store, &[], &[]);
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains(words), "{said}");
        for secret in ["anna", "pa55w0rd", "loopback"] {
            assert!(!said.contains(secret), "{secret} in {said}");
        }
    }
    let (code, said) = refused("sqlite", &[], &["--role", "worker"]);
    assert!(code == Some(1) && said.contains("role"), "{said}");
    // Nor where it works, however much is logged.
    let data = tempfile::tempdir().unwrap();
    let log = data.path().join("log");
    let folder = data.path().to_str().unwrap();
    let arguments = ["serve", "--listen", "127.0.0.1:0", "--data", folder, "--store", &database.address];
    let mut child = toy_command(&arguments)
        .env("PRECUT_LOG_LEVEL", "trace")
        .stderr(std::fs::File::create(&log).unwrap())
        .spawn()
        .unwrap();
    crate::support::address_of(&mut child);
    // It says where it listens before it writes that down.
    let log_read = || std::fs::read_to_string(&log).unwrap();
    until("the last line of the start", async || log_read().contains("serving").then_some(())).await;
    child.kill().unwrap();
    child.wait().unwrap();
    let said = log_read();
    assert!(said.contains("serving") && !said.contains("loopback"), "{}", &said[..said.len().min(2000)]);
}

#[tokio::test]
async fn a_database_of_a_newer_program_or_without_rights_is_refused_and_left_alone() {
    let Some(database) = Database::start() else { return };
    Member::start(&database, "api", &[]).await.stop();
    let pool = database.pool().await;
    sqlx::query("INSERT INTO precut.versions VALUES (1000, 1000)").execute(&pool).await.unwrap();
    let (code, said) = refused(&database.address, &[], &[]);
    assert!(code == Some(1) && said.contains("newer precut"), "{said}");
    sqlx::query("DELETE FROM precut.versions WHERE version = 1000").execute(&pool).await.unwrap();
    sqlx::query("ALTER DATABASE postgres SET default_transaction_read_only = on").execute(&pool).await.unwrap();
    let (code, said) = refused(&database.address, &[], &[]);
    assert!(code == Some(1) && said.contains("read-only"), "{said}");
}
