"""MAVLink FTP and the files that it serves."""
