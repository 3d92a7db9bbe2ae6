-- Who is to be told that a job is over: see the SQLite file. Programs that know nothing of it can live with it: what they
-- end is told by those that do.
CREATE TABLE precut.callbacks (
    job        text COLLATE "C" NOT NULL PRIMARY KEY REFERENCES precut.jobs (id) ON DELETE CASCADE,
    url        text    NOT NULL,
    host       text    NOT NULL,
    state      text    NOT NULL CHECK (state IN ('waiting', 'pending', 'delivered', 'given_up')),
    attempts   integer NOT NULL DEFAULT 0,
    next_ms    bigint  CHECK ((next_ms IS NOT NULL) = (state = 'pending')),
    lease      text,
    fault      text,
    settled_ms bigint
) WITH (fillfactor = 70);
CREATE INDEX callbacks_due ON precut.callbacks (next_ms) WHERE state = 'pending';
-- With the rights of the owner: what ends jobs may be a program that was granted nothing here yet.
CREATE FUNCTION precut.call_back() RETURNS trigger LANGUAGE plpgsql SECURITY DEFINER SET search_path = precut, pg_temp AS $$
BEGIN
    UPDATE precut.callbacks SET state = 'pending', next_ms = coalesce(NEW.finished_ms, 0) WHERE job = NEW.id AND state = 'waiting';
    RETURN NULL;
END $$;
CREATE TRIGGER callbacks_of_what_is_over AFTER UPDATE OF state ON precut.jobs FOR EACH ROW
    WHEN (NEW.state IN ('succeeded', 'failed', 'cancelled')) EXECUTE FUNCTION precut.call_back();

-- Where the request belongs in a trace (W3C Trace Context).
ALTER TABLE precut.jobs ADD COLUMN traceparent text;
INSERT INTO precut.versions VALUES (4, 1);
