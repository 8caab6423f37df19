"""Loops on a target over the PIL link: messages, client, session, and the loops behind a ``ByteLink``."""
