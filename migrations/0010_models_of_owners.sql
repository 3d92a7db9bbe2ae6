-- What stored models take counts for whoever stored them. The owner stands before the name where there are keys; models
-- of a service without keys, stored before this, count for nobody.
ALTER TABLE models ADD COLUMN owner TEXT NOT NULL DEFAULT '';
ALTER TABLE models ADD COLUMN bytes INTEGER NOT NULL DEFAULT 0;
UPDATE models SET
    owner = iif(instr(name, '/') > 0,
                'key:' || replace(replace(substr(name, 1, instr(name, '/') - 1), '%2F', '/'), '%25', '%'), ''),
    bytes = coalesce(octet_length(content), 0);
CREATE INDEX models_use ON models (owner, bytes) WHERE content IS NOT NULL;
