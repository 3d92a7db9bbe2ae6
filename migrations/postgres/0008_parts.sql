-- Parts of jobs are kept, too.
ALTER TABLE precut.documents
    DROP CONSTRAINT documents_kind_check,
    ADD CONSTRAINT documents_kind_check CHECK (kind IN ('model', 'machine', 'tool', 'material', 'part'));
INSERT INTO precut.versions VALUES (8, 1);
