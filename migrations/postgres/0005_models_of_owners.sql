-- What stored models take counts for whoever stored them: see the SQLite file. What programs before this store counts for
-- nobody.
ALTER TABLE precut.models
    ADD COLUMN owner text NOT NULL DEFAULT '',
    ADD COLUMN bytes bigint NOT NULL DEFAULT 0;
UPDATE precut.models SET
    owner = CASE WHEN position('/' IN name) > 0
        THEN 'key:' || replace(replace(split_part(name, '/', 1), '%2F', '/'), '%25', '%') ELSE '' END,
    bytes = coalesce(octet_length(content), 0);
CREATE INDEX models_use ON precut.models (owner) INCLUDE (bytes) WHERE content IS NOT NULL;
INSERT INTO precut.versions VALUES (5, 1);
