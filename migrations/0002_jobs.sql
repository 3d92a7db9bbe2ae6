-- Jobs: what was asked, how far it is, how it ended. The queue's own tables (`Jobs`, `Workers`, made by apalis) say who
-- runs which of them; what is true of a job stands here alone. Not called `jobs`: names of tables know no case.
CREATE TABLE precut_jobs (
    id           TEXT    NOT NULL PRIMARY KEY,
    kind         TEXT    NOT NULL CHECK (kind IN ('calculation', 'study')),
    calculator   TEXT    NOT NULL,
    version      INTEGER NOT NULL,
    -- Address of the result: equal jobs have equal keys and share one computation.
    key          BLOB    NOT NULL CHECK (length(key) = 32),
    -- zstd of the filled job; of what else a kind needs to run it again.
    input        BLOB    NOT NULL,
    state        TEXT    NOT NULL CHECK (state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')),
    stage        TEXT    CHECK (stage IS NULL OR json_valid(stage)),
    progress     REAL    NOT NULL DEFAULT 0.0,
    -- Starts charged so far.
    attempt      INTEGER NOT NULL DEFAULT 0,
    -- Who runs it: a token of one start of one computation. Every write of who runs it names the token.
    lease        TEXT    CHECK ((lease IS NOT NULL) = (state = 'running')),
    heartbeat_ms INTEGER,
    priority     INTEGER NOT NULL CHECK (priority BETWEEN 0 AND 2),
    -- Place in the fair order of its priority, see `turn` in the code.
    turn         INTEGER NOT NULL,
    -- Tasks given to the queue so far: a task's name is never used twice.
    pushed       INTEGER NOT NULL DEFAULT 0,
    owner        TEXT    NOT NULL,
    idempotency  TEXT,
    body_hash    BLOB    CHECK (body_hash IS NULL OR length(body_hash) = 32),
    -- Why it failed: a code with its numbers.
    problem      TEXT    CHECK (problem IS NULL OR json_valid(problem)),
    estimate_ms  REAL    NOT NULL,
    created_ms   INTEGER NOT NULL,
    started_ms   INTEGER,
    finished_ms  INTEGER,
    deadline_ms  INTEGER,
    expires_ms   INTEGER,
    UNIQUE (owner, idempotency)
) STRICT;

CREATE INDEX precut_jobs_by_state ON precut_jobs (state, id);
CREATE INDEX precut_jobs_by_calculator ON precut_jobs (calculator, id);
CREATE INDEX precut_jobs_by_key ON precut_jobs (key, state, expires_ms);
CREATE INDEX precut_jobs_by_lease ON precut_jobs (lease) WHERE lease IS NOT NULL;
CREATE INDEX precut_jobs_in_line ON precut_jobs (priority, turn) WHERE state = 'queued';
CREATE INDEX precut_jobs_of_owner ON precut_jobs (owner, priority, turn) WHERE state = 'queued';
CREATE INDEX precut_jobs_by_deadline ON precut_jobs (deadline_ms)
    WHERE deadline_ms IS NOT NULL AND state IN ('queued', 'running');
CREATE INDEX precut_jobs_by_expiry ON precut_jobs (expires_ms) WHERE expires_ms IS NOT NULL;

-- What jobs took against what was estimated: calibrates estimates.
CREATE TABLE timings (
    calculator   TEXT    NOT NULL,
    version      INTEGER NOT NULL,
    predicted_ms REAL    NOT NULL,
    actual_ms    REAL    NOT NULL,
    at_ms        INTEGER NOT NULL
) STRICT;
CREATE INDEX timings_by_calculator ON timings (calculator, version, at_ms);
