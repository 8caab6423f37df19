"""The review of a flight: data, summary, charts and the page."""
