FROM python:3.11-slim-bookworm

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
