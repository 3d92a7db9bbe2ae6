-- Who has asked for which result: where the service asks for keys, an owner sees those of his own. Results stay shared by
-- their content, whoever asked first. Those of jobs are told by the jobs. Programs that know nothing of it can live with it.
CREATE TABLE precut.asked (
    key   bytea NOT NULL CHECK (octet_length(key) = 32),
    owner text  NOT NULL,
    PRIMARY KEY (key, owner)
);
CREATE FUNCTION precut.forget_asked() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    DELETE FROM precut.asked USING gone WHERE asked.key = gone.key;
    RETURN NULL;
END $$;
CREATE TRIGGER asked_as_long_as_kept AFTER DELETE ON precut.results
    REFERENCING OLD TABLE AS gone FOR EACH STATEMENT EXECUTE FUNCTION precut.forget_asked();
INSERT INTO precut.versions VALUES (2, 1);
