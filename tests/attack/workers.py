"""A process that executes commands for the attack and is replaced when it hangs or dies."""

import multiprocessing


def invoke(arguments):
    """(exit code, what was printed at the end, crashed) of a command in this process."""
    from typer.testing import CliRunner

    from beamsim.cli.app import app

    result = CliRunner().invoke(app, arguments)
    error = result.exception
    crashed = error is not None and not isinstance(error, SystemExit)
    return result.exit_code, (repr(error) if crashed else "") + result.output[-400:], crashed


class Worker:
    """A process that runs ``work(connection)``; ``warming`` holds the jobs it is sent first."""

    def __init__(self, work, warming=()):
        self.work, self.warming = work, warming

    def __enter__(self):
        self._start()
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.join()

    def _start(self):
        context = multiprocessing.get_context("spawn")
        self.connection, other = context.Pipe()
        self.process = context.Process(target=self.work, args=(other,))
        self.process.start()
        other.close()
        for job in self.warming:
            self.connection.send(job)
            self.connection.recv()

    def run(self, job, patience):
        """(exit code, output, crashed); code -9 for no answer within a time in s, another negative one for a death."""
        self.connection.send(job)
        if not self.connection.poll(patience):
            self.process.kill()
            self.process.join()
            self._start()
            return -9, f"no answer within {patience:g} s", True
        try:
            return self.connection.recv()
        except EOFError:
            self.process.join()
            code = self.process.exitcode
            self._start()
            return -abs(code or 1), "the process died", True
