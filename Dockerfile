FROM python:3.11-slim-bookworm

# Debian keeps no earlier versions of packages, so their versions are not pinned.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends make git \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /serd
COPY . .
RUN make setup

ENV PATH="/serd/.venv/bin:${PATH}"
ENTRYPOINT ["serd"]
CMD ["demo"]
