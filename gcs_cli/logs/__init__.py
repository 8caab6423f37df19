"""Flight logs of any vehicle, ULog or tlog: read, describe, plot, export, replay."""
