"""The link to the vehicle: endpoint, session, requests and recording."""
