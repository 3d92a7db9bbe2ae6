//! The process that the tests start.

/// Not a test: the process that the others start.
#[test]
#[ignore = "started by other tests"]
fn child_process() {
    crate::support::be_child();
}
