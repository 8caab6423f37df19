"""The MAVLink FTP server and its files."""
