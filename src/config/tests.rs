//! The configuration from its sources, and what is wrong with it.
#![allow(clippy::unwrap_used)]

use super::*;

fn load(file: &str, environment: &[(&str, &str)], flags: &Flags) -> Result<Config, ConfigError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("precut.toml");
    std::fs::write(&path, file).unwrap();
    let environment = environment.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
    Config::from_sources(Some(&path), environment, flags)
}

#[test]
fn the_default_file_is_complete_and_valid() {
    assert_eq!(load("", &[], &Flags::default()).unwrap(), Config::default());
}

#[test]
fn flags_win_over_environment_over_file_over_defaults() {
    let file = "data = \"from-file\"\ncpu = 1\n[limits]\njson_bytes = 1\nburst = 7.0\n[log]\nformat = \"json\"";
    let environment = [
        ("PRECUT_DATA", "from-environment"),
        ("PRECUT_LIMITS_JSON_BYTES", "2"),
        ("PRECUT_CONFIG", "ignored-here"),
        ("HOME", "/nobody"),
    ];
    let flags = Flags {
        data: Some("from-flag".into()),
        log_level: Some("debug".to_owned()),
        listen: Some("127.0.0.1:9".parse().unwrap()),
        ..Flags::default()
    };
    let config = load(file, &environment, &flags).unwrap();
    assert_eq!(config.data, PathBuf::from("from-flag"));
    assert_eq!(config.limits.json_bytes, 2);
    assert_eq!(config.cpu, 1);
    assert_eq!(config.log, Log { level: "debug".to_owned(), format: LogFormat::Json });
    assert_eq!(config.listen.port(), 9);
    assert_eq!(config.limits.multipart_bytes, Config::default().limits.multipart_bytes);
    let config = load(file, &[("PRECUT_DATA", "2026")], &Flags::default()).unwrap();
    assert_eq!(config.data, PathBuf::from("2026"));
}

#[test]
fn unknown_keys_are_refused_by_name_wherever_they_stand() {
    let error = load("[limits]\njson_byte = 1", &[], &Flags::default()).unwrap_err().to_string();
    assert!(error.contains("json_byte") && error.contains("precut.toml"), "{error}");
    let error = load("", &[("PRECUT_LIMITS_JSON_BYTE", "1")], &Flags::default()).unwrap_err().to_string();
    assert!(error.contains("json_byte") && error.contains("PRECUT_LIMITS_JSON_BYTE"), "{error}");
}

#[test]
fn a_stray_variable_stops_nothing_and_is_told_with_the_nearest() {
    let strays = [("PRECUT_LISTN", "127.0.0.1:1"), ("PRECUT_URL", "http://cam"), ("PRECUT_PORT", "8080")];
    let config = load("", &strays, &Flags::default()).unwrap();
    assert_eq!(config.listen, Config::default().listen);
    assert_eq!(config.strays.len(), 3);
    assert!(config.strays[0].contains("PRECUT_LISTN") && config.strays[0].contains("PRECUT_LISTEN?"));
    assert!(config.strays[1].contains("PRECUT_URL") && !config.strays[1].contains("did you mean"));
}

#[test]
fn an_address_of_its_own_for_health_and_metrics_is_none_unless_it_is_given() {
    assert_eq!(Config::default().admin_listen, None);
    let config = load("", &[("PRECUT_ADMIN_LISTEN", "127.0.0.1:9090")], &Flags::default()).unwrap();
    assert_eq!(config.admin_listen, Some("127.0.0.1:9090".parse().unwrap()));
    assert_eq!(toml::from_str::<Config>(&config.to_toml()).unwrap(), config);
    assert!(config.is_loopback());
    let config = load("admin_listen = \"0.0.0.0:9090\"", &[], &Flags::default()).unwrap();
    assert!(!config.is_loopback(), "others reach the metrics, too");
    let error = load("admin_listen = \"here\"", &[], &Flags::default()).unwrap_err().to_string();
    assert!(error.contains("admin_listen"), "{error}");
}

#[test]
fn what_is_no_setting_is_left_alone() {
    let others = [
        ("PRECUT_LANG", "ru"),
        ("PRECUT_SERVICE_HOST", "10.0.0.7"),
        ("PRECUT_SERVICE_PORT_HTTP", "8080"),
        ("PRECUT_PORT", "tcp://10.0.0.7:8080"),
        ("PRECUT_PORT_8080_TCP_ADDR", "10.0.0.7"),
    ];
    assert_eq!(load("", &others, &Flags::default()).unwrap(), Config::default());
}

#[test]
fn senseless_values_are_all_reported_at_once() {
    let file = "[limits]\njson_bytes = 0\nbody_timeout_s = -1.0\n[cors]\norigins = [\"cam\"]\n\
                [auth]\nkeys = [{ name = \"cam\", hash = \"12\" }]\n[log]\nlevel = \"precut=loud\"";
    let error = load(file, &[], &Flags::default()).unwrap_err().to_string();
    for name in ["json_bytes", "body_timeout_s", "cors.origins", "auth.keys[0]", "log.level"] {
        assert!(error.contains(name), "{name} missing in: {error}");
    }
}

#[test]
fn settings_of_the_wrong_type_are_reported_with_all_others() {
    let file = "cpu = \"many\"\n[limits]\njson_bytes = \"big\"\nburst = 0.5\n[log]\nformat = \"xml\"";
    let error = load(file, &[("PRECUT_LISTEN", "here")], &Flags::default()).unwrap_err().to_string();
    for name in ["cpu", "limits.json_bytes", "limits.burst", "log.format", "PRECUT_LISTEN"] {
        assert!(error.contains(name), "{name} missing in: {error}");
    }
    assert_eq!(error.lines().count(), 5, "{error}");
}

#[test]
fn a_host_that_may_be_called_is_brought_into_its_one_form() {
    let host = |text| allowed_host(text).map(|(host, port)| format!("{host} {port:?}"));
    assert_eq!(host("MES.Plant.example").as_deref(), Some("mes.plant.example None"));
    assert_eq!(host("mes.plant.example.:8443").as_deref(), Some("mes.plant.example Some(8443)"));
    assert_eq!(host("mes.plant.example:443").as_deref(), Some("mes.plant.example Some(443)"));
    assert_eq!(host("0x7f.1:80").as_deref(), Some("127.0.0.1 Some(80)"));
    assert_eq!(host("[::1]:8000").as_deref(), Some("[::1] Some(8000)"));
    for bad in ["", "https://mes.plant.example", "mes/path", "user@mes", "mes:", "mes:x", "*", "a b", "mes?x", "mes#x"]
    {
        assert_eq!(host(bad), None, "{bad}");
    }
}

#[test]
fn settings_of_what_is_sent_outward_are_looked_at() {
    let file = "[callbacks]\nhosts = [\"https://mes\"]\ntimeout_s = 0.0\npauses_s = [-1.0]\n\
                owners = [{ owner = \"cam\", secret_file = \"\" }]\n\
                [traces]\nendpoint = \"collector:4318\"\nshare = 2.0";
    let error = load(file, &[], &Flags::default()).unwrap_err().to_string();
    for name in ["hosts", "secret_file", "owners", "timeout_s", "pauses_s"].map(|name| format!("callbacks.{name}")) {
        assert!(error.contains(&name), "{name} missing in: {error}");
    }
    assert!(error.contains("traces.endpoint") && error.contains("traces.share"), "{error}");
    let environment = [("PRECUT_CALLBACKS_HOSTS", "[\"mes:80\"]"), ("PRECUT_CALLBACKS_SECRET_FILE", "12")];
    let config = load("", &environment, &Flags::default()).unwrap();
    assert_eq!((config.callbacks.hosts, config.callbacks.secret_file), (vec!["mes:80".to_owned()], "12".to_owned()));
}

#[test]
fn the_printed_configuration_reads_back_and_hides_secrets() {
    let mut config = Config::default();
    assert_eq!(toml::from_str::<Config>(&config.to_toml()).unwrap(), config);
    let hash = "ab".repeat(32);
    config.auth.keys.push(ApiKey { name: "cam".to_owned(), hash: hash.clone(), ..ApiKey::default() });
    assert!(!config.to_toml().contains(&hash));
}
