-- Stored models, machines, tools and materials are documents of one sort: see the SQLite file. Programs that know only models
-- find and keep them behind a view.
ALTER TABLE precut.models RENAME TO documents;
ALTER TABLE precut.documents RENAME COLUMN calculator TO class;
ALTER TABLE precut.documents
    ADD COLUMN kind text NOT NULL DEFAULT 'model' CHECK (kind IN ('model', 'machine', 'tool', 'material')),
    ADD COLUMN words text NOT NULL DEFAULT '',
    DROP CONSTRAINT models_pkey,
    ADD PRIMARY KEY (kind, name, revision);
DROP INDEX precut.models_use;
CREATE INDEX documents_use ON precut.documents (owner) INCLUDE (kind, bytes) WHERE content IS NOT NULL;
CREATE VIEW precut.models AS
    SELECT name, revision, class AS calculator, content, sha256, created_ms, owner, bytes
    FROM precut.documents WHERE kind = 'model';

-- Counts every change of a document, so that a process knows whether what it remembers of names still holds. Whoever writes
-- documents holds its row: one after the other, so that no two take the same number. Programs that know nothing of it count,
-- too.
CREATE TABLE precut.library (generation bigint NOT NULL);
INSERT INTO precut.library VALUES (0);
CREATE FUNCTION precut.library_changed() RETURNS trigger LANGUAGE plpgsql SECURITY DEFINER SET search_path = precut, pg_temp AS $$
BEGIN
    UPDATE precut.library SET generation = generation + 1;
    PERFORM pg_notify('precut_news', '{"library":true}');
    RETURN NULL;
END $$;
CREATE TRIGGER documents_changed AFTER INSERT OR UPDATE OR DELETE ON precut.documents
    FOR EACH STATEMENT EXECUTE FUNCTION precut.library_changed();
INSERT INTO precut.versions VALUES (7, 1);
