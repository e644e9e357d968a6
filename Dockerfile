# docker build -t cubestack .
# docker run --rm cubestack measure cubestar --frames 3
# docker run --rm -p 127.0.0.1:5000:5000 cubestack emulate cubestar --tcp 5000 --listen 0.0.0.0 --allow-remote
FROM python:3.11-slim AS build
COPY . /source
RUN python -m venv /opt/cubestack && /opt/cubestack/bin/pip install --no-cache-dir "/source[ground]" \
    && find /opt/cubestack -name __pycache__ -prune -exec rm -r {} +

# No compiler: the compiled FPGAs of the shipped sensors come along with the package.
FROM python:3.11-slim
RUN useradd --create-home cubestack
COPY --from=build /opt/cubestack /opt/cubestack
ENV PATH=/opt/cubestack/bin:$PATH
USER cubestack
WORKDIR /home/cubestack
ENTRYPOINT ["cubestack"]
CMD ["--help"]
