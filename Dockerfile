# raymarch without a display: docker build -t raymarch . && docker run --rm -v "$PWD:/work" raymarch render scene.py
FROM debian:bookworm-slim
RUN apt-get update \
    && apt-get install -y --no-install-recommends python3-venv libegl1 libgl1 libgl1-mesa-dri \
    && rm -rf /var/lib/apt/lists/*
COPY pyproject.toml README.md LICENSE /src/
COPY raymarch /src/raymarch
RUN python3 -m venv /opt/raymarch && /opt/raymarch/bin/pip install --no-cache-dir /src && rm -r /src
ENV PATH=/opt/raymarch/bin:$PATH
WORKDIR /work
ENTRYPOINT ["raymarch"]
CMD ["--help"]
