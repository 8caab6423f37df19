"""An engine whose flight stack and simulator exchange the bytes of every state and every answer."""

from flightstack.testing.engine import Engine


class BytesEngine(Engine):
    """Exchanges the bytes of every state and every answer."""

    def states(self) -> bytes | memoryview:
        return super().states()
