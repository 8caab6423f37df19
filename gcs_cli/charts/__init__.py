"""Charts: one description of a figure, drawn on pages by plotly.js and for print by matplotlib."""
