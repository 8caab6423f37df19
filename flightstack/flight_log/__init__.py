"""The flight's log: a streaming ULog writer."""
