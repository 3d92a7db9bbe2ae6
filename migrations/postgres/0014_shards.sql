-- A shard of a large study is a job of its own, in the same line. `parent` is the key of the study, so that equal studies share
-- their shards; `content` is what the shard came to (zstd with a checksum). No owner has it, and no list shows it.
DROP INDEX precut.jobs_want_help;
ALTER TABLE precut.jobs
    DROP COLUMN help,
    ADD COLUMN parent bytea CHECK (parent IS NULL OR octet_length(parent) = 32),
    ADD COLUMN shard integer CHECK ((shard IS NULL) = (parent IS NULL)),
    ADD COLUMN content bytea;
ALTER TABLE precut.jobs ALTER COLUMN content SET STORAGE EXTERNAL;
DROP INDEX precut.jobs_by_state;
CREATE INDEX jobs_by_state ON precut.jobs (state, parent, id);
CREATE INDEX jobs_of_parent ON precut.jobs (parent, state, id) WHERE parent IS NOT NULL;

-- A study ends in many ways, and with the last of equal ones its shards go. Who just writes one of them is not waited for: he may
-- wait for the study's own record. What is left of that is not taken any more, and forgotten within a minute.
CREATE FUNCTION precut.forget_shards() RETURNS trigger LANGUAGE plpgsql SECURITY DEFINER SET search_path = precut, pg_temp AS $$
BEGIN
    DELETE FROM precut.jobs WHERE id IN (
        SELECT id FROM precut.jobs WHERE parent = OLD.key AND NOT EXISTS (
            SELECT FROM precut.jobs AS other WHERE other.key = OLD.key AND other.state IN ('queued', 'running'))
        FOR UPDATE SKIP LOCKED);
    RETURN NULL;
END $$;
CREATE TRIGGER shards_of_what_is_over AFTER UPDATE OF state ON precut.jobs FOR EACH ROW
    WHEN (NEW.parent IS NULL AND NEW.state IN ('succeeded', 'failed', 'cancelled')) EXECUTE FUNCTION precut.forget_shards();

-- The parts that earlier programs kept beside the jobs. Their points are kept as results and are not computed again.
DROP TABLE precut.studies, precut.shared_studies;
-- Programs before this ask for help, and would show shards.
INSERT INTO precut.versions VALUES (14, 14);
