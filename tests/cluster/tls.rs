//! TLS to the database: an authority of the test's own, a server with its certificate, and who refuses whom.

use serde_json::json;

use crate::certificates::{certificate, signed};
use crate::database::{Database, Member};
use crate::start::refused;
use crate::support::toy;

#[tokio::test]
async fn the_way_to_the_database_is_encrypted_and_who_is_there_is_checked_as_asked() {
    let folder = tempfile::Builder::new().prefix("precut-postgres-").tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    if certificate(folder.path(), "plant", &["-subj", "/CN=plant"]).is_none() {
        return;
    }
    certificate(folder.path(), "other", &["-subj", "/CN=other"]).unwrap();
    signed(folder.path(), "server", &["-subj", "/CN=database", "-addext", "subjectAltName=DNS:localhost"]).unwrap();
    // Nobody comes in without TLS, and one user only with a certificate of his own.
    let lines = "hostssl all carded 127.0.0.1/32 scram-sha-256 clientcert=verify-ca\n\
                 hostssl all all 127.0.0.1/32 scram-sha-256\n";
    std::fs::write(folder.path().join("access"), lines).unwrap();
    let (hba, certificate, key, authority) = (at("access"), at("server.pem"), at("server.key"), at("plant.pem"));
    let settings = [
        "ssl=on".to_owned(),
        format!("hba_file={hba}"),
        format!("ssl_cert_file={certificate}"),
        format!("ssl_key_file={key}"),
        format!("ssl_ca_file={authority}"),
    ];
    let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
    let Some(mut database) = Database::start_in(folder.path(), &settings) else { return };
    let pool = database.pool().await;
    for command in ["CREATE USER carded SUPERUSER PASSWORD 'loopback'", "CREATE DATABASE precut OWNER carded"] {
        sqlx::query(command).execute(&pool).await.unwrap();
    }
    let by_number = database.address_with("/postgres", "/precut");
    let by_name = by_number.replace("127.0.0.1", "localhost");
    let as_carded = by_name.replace("precut:", "carded:");

    for (address, parameters, words) in [
        (&by_number, "sslmode=disable", "not encrypted (sslmode=disable)"),
        (&by_name, "sslmode=verify-full", "the authority that signed it is not trusted here"),
        (&by_name, &format!("sslmode=verify-full&sslrootcert={}", at("other.pem")), "sslrootcert=FILE"),
        (&by_number, &format!("sslmode=verify-full&sslrootcert={authority}"), "another host than the address says"),
        (&by_name, &format!("sslmode=require&sslrootcert={}", at("other.pem")), "(sslmode=verify-ca)"),
        (&by_name, &format!("sslrootcert={authority}"), "say sslmode=verify-full"),
        (&as_carded, "sslmode=require", "sslcert=FILE and sslkey=FILE"),
        (
            &as_carded,
            &format!("sslmode=require&sslcert={}&sslkey={}", at("other.pem"), at("other.key")),
            "it refused TLS with us",
        ),
    ] {
        let (code, said) = refused(&format!("{address}?{parameters}"), &[], &[]);
        assert!(code == Some(1) && said.contains(words), "{parameters}: {said}");
        assert!(!said.contains("waiting for the database"), "waiting does not help: {said}");
        assert!(!said.contains("loopback") && !said.contains("carded"), "credentials: {said}");
    }

    signed(folder.path(), "carded", &["-subj", "/CN=carded"]).unwrap();
    let allowed = [
        (&by_name, format!("sslmode=verify-full&sslrootcert={authority}")),
        (&by_number, format!("sslmode=verify-ca&sslrootcert={authority}")),
        (
            &as_carded,
            format!(
                "sslmode=verify-full&sslrootcert={authority}&sslcert={}&sslkey={}",
                at("carded.pem"),
                at("carded.key")
            ),
        ),
        (&by_number, "sslmode=require".to_owned()),
        // Where nothing is said, the server is asked whether it offers it.
        (&by_number, String::new()),
    ];
    for ((address, parameters), length_mm) in allowed.into_iter().zip(100..) {
        database.address = format!("{address}?{parameters}");
        let member = Member::start(&database, "all", &[]).await;
        let job = member.accepted(&format!("/v1/{}", toy::BAR), &json!({"length_mm": length_mm, "load_n": 1})).await;
        member.job_in(&job, "succeeded").await;
        let count = "SELECT count(*), count(*) FILTER (WHERE ssl) FROM pg_stat_ssl JOIN pg_stat_activity USING (pid) \
                     WHERE application_name = 'precut'";
        let (all, encrypted): (i64, i64) = sqlx::query_as(count).fetch_one(&pool).await.unwrap();
        println!("{parameters}: {all} connections, {encrypted} encrypted");
        assert!(all >= 2 && all == encrypted, "one that listens and others, all encrypted");
        member.stop();
    }
}

#[tokio::test]
async fn a_server_without_tls_is_refused_where_it_is_asked_for() {
    let Some(mut database) = Database::start() else { return };
    let (code, said) = refused(&format!("{}?sslmode=require", database.address), &[], &[]);
    assert!(code == Some(1) && said.contains("it offers no TLS, which sslmode=require asks for"), "{said}");
    assert!(said.contains("sslmode=disable") && !said.contains("loopback"), "{said}");
    // As it says, and where nothing is said.
    Member::start(&database, "api", &[]).await.stop();
    database.address.push_str("?sslmode=disable");
    Member::start(&database, "api", &[]).await.stop();
}
