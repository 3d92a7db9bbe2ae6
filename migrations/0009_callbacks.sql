-- Who is to be told that a job is over: one row for each job that asked for it. It stays as long as the job's record.
CREATE TABLE callbacks (
    job        TEXT    NOT NULL PRIMARY KEY REFERENCES precut_jobs (id) ON DELETE CASCADE,
    url        TEXT    NOT NULL,
    -- Host and port of the address: none of them takes the places of all others.
    host       TEXT    NOT NULL,
    -- waiting: the job is not over; pending: it is to be told.
    state      TEXT    NOT NULL CHECK (state IN ('waiting', 'pending', 'delivered', 'given_up')),
    -- Tries begun.
    attempts   INTEGER NOT NULL DEFAULT 0,
    -- When it is tried next; while somebody tries, when he is taken for dead.
    next_ms    INTEGER CHECK ((next_ms IS NOT NULL) = (state = 'pending')),
    -- Who tries: only he can write what came of it.
    lease      TEXT,
    -- Why the last try came to nothing: a code.
    fault      TEXT,
    -- When it was delivered or given up.
    settled_ms INTEGER
) STRICT, WITHOUT ROWID;
CREATE INDEX callbacks_due ON callbacks (next_ms) WHERE state = 'pending';
-- A job ends in many ways, and each of them has to be told.
CREATE TRIGGER callbacks_of_what_is_over AFTER UPDATE OF state ON precut_jobs
WHEN NEW.state IN ('succeeded', 'failed', 'cancelled') BEGIN
    UPDATE callbacks SET state = 'pending', next_ms = coalesce(NEW.finished_ms, 0) WHERE job = NEW.id AND state = 'waiting';
END;

-- Where the request belongs in a trace (W3C Trace Context).
ALTER TABLE precut_jobs ADD COLUMN traceparent TEXT;
