"""Finding, reading, quoting and writing files, whatever they hold."""
