"""Work in a thread: of the jobs that wait and of their results, the newest alone counts."""

import threading

from serd_app.navigation.newest_job import NewestJob
from support.waiting import wait_until


def test_a_burst_of_jobs_runs_the_first_and_the_newest_and_returns_the_newest():
    jobs, held, ran = NewestJob(), threading.Event(), []

    def job(number):
        held.wait(10.0)
        ran.append(number)
        return number

    for number in range(20):
        jobs.begin(lambda number=number: job(number))
        if number == 0:
            wait_until(lambda: jobs._waiting is None)
    held.set()
    results = []
    wait_until(lambda: results.append(jobs.poll()) or results[-1] is not None)
    assert (ran, results[-1], jobs.poll()) == ([0, 19], 19, None)


def test_the_exception_of_a_job_is_its_result_and_what_was_forgotten_has_none():
    jobs = NewestJob()
    jobs.begin(lambda: 1 / 0)
    results = []
    wait_until(lambda: results.append(jobs.poll()) or results[-1] is not None)
    assert isinstance(results[-1], ZeroDivisionError)
    held = threading.Event()
    jobs.begin(lambda: held.wait(10.0))
    jobs.forget()
    held.set()
    wait_until(lambda: not jobs._is_running)
    assert jobs.poll() is None
