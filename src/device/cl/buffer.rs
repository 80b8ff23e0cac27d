//! Typed memory on an OpenCL device.

use std::cell::Cell;
use std::marker::PhantomData;
use std::ptr;
use std::rc::Rc;

use bytemuck::Pod;
use opencl3::error_codes::{CL_MEM_OBJECT_ALLOCATION_FAILURE, ClError};
use opencl3::memory::{Buffer as ClBuffer, CL_MAP_READ, CL_MEM_READ_WRITE, ClMem};
use opencl3::types::{CL_BLOCKING, cl_mem, cl_uchar};

use super::{Context, failed};
use crate::device::injected_faults;
use crate::device::live_objects::{Api, Counted};
use crate::error::Result;
use crate::records::TEXEL;

/// Where parts of a buffer may begin, bytes: no driver asks for more (PoCL 128, NVIDIA 512).
pub const PART_ALIGNMENT: usize = 4096;

/// `len` records of `T` in device memory; freed when dropped.
pub struct Buffer<T> {
    memory: ClBuffer<cl_uchar>,
    len: usize,
    of: PhantomData<T>,
    /// Takes the bytes off the context's account when the memory is freed; parts of a buffer have none of their own.
    account: Option<Entry>,
}

/// Bytes on a context's account.
struct Entry {
    memory: Rc<Memory>,
    bytes: usize,
    _counted: Counted,
}

impl Drop for Entry {
    fn drop(&mut self) {
        self.memory.held.set(self.memory.held.get() - self.bytes);
    }
}

/// What buffers hold of a device, bytes.
#[derive(Default)]
pub struct Memory {
    held: Cell<usize>,
    most: Cell<usize>,
}

impl Memory {
    /// Bytes held now.
    pub fn held(&self) -> usize {
        self.held.get()
    }

    /// Most at any time.
    pub fn most(&self) -> usize {
        self.most.get()
    }

    fn enter(self: &Rc<Memory>, bytes: usize) -> Entry {
        self.held.set(self.held.get() + bytes);
        self.most.set(self.most.get().max(self.held.get()));
        Entry { memory: Rc::clone(self), bytes, _counted: Counted::new(Api::OpenCl) }
    }
}

impl<T: Pod> Buffer<T> {
    /// Uninitialised memory. OpenCL has no empty buffers: one record is allocated where none is asked for.
    ///
    /// # Errors
    /// [`crate::error::Error::Memory`], with the size, when the device has no room.
    pub fn new(context: &Context, len: usize) -> Result<Buffer<T>> {
        let bytes = len.max(1) * size_of::<T>();
        let full = |e| failed(&format!("{bytes} bytes on {}", context.device.name), e);
        if injected_faults::of_memory(context.memory.held() + bytes) {
            return Err(full(ClError(CL_MEM_OBJECT_ALLOCATION_FAILURE)));
        }
        // SAFETY: no host pointer is given, so nothing is aliased.
        let memory =
            unsafe { ClBuffer::create(&context.context, CL_MEM_READ_WRITE, bytes, ptr::null_mut()) }.map_err(full)?;
        Ok(Buffer { memory, len, of: PhantomData, account: Some(context.memory.enter(bytes)) })
    }

    /// A copy of `data` on the device.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the device has no room.
    pub fn from_slice(context: &Context, data: &[T]) -> Result<Buffer<T>> {
        let mut buffer = Buffer::new(context, data.len())?;
        buffer.write(context, data)?;
        Ok(buffer)
    }

    /// Makes the buffer at least so long; its content is lost when it grows. One that has grown before gets an eighth more
    /// than it needs: views that move ask for a little more in every picture, and fresh memory costs a GPU's driver 0.1 ms
    /// and more.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn fit(&mut self, context: &Context, len: usize) -> Result<()> {
        if self.len < len {
            let spare = if self.is_empty() { 0 } else { len / 8 };
            // Lists that are whole texels stay so.
            *self = Buffer::new(context, len + spare / TEXEL * TEXEL)?;
        }
        Ok(())
    }

    /// The same memory as records of another type; what it holds becomes meaningless.
    ///
    /// # Panics
    /// When the types differ in size.
    pub fn cast<U: Pod>(self) -> Buffer<U> {
        assert_eq!(size_of::<T>(), size_of::<U>(), "records of another size");
        Buffer { memory: self.memory, len: self.len, of: PhantomData, account: self.account }
    }

    /// `len` records of `U` within this memory, from byte `first` on: the same bytes under another name, which live as
    /// long as either does. `first` must be a multiple of [`PART_ALIGNMENT`].
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses.
    ///
    /// # Panics
    /// When the part lies outside of the buffer, or begins elsewhere.
    pub fn part<U: Pod>(&self, first: usize, len: usize) -> Result<Buffer<U>> {
        let bytes = len.max(1) * size_of::<U>();
        assert!(first % PART_ALIGNMENT == 0 && first + bytes <= self.bytes(), "{bytes} bytes from {first} on");
        // SAFETY: OpenCL checks the range, and keeps the memory for as long as a part of it is in use.
        let memory = unsafe { self.memory.create_sub_buffer(CL_MEM_READ_WRITE, first, bytes) }
            .map_err(|e| failed(&format!("a part of {bytes} bytes"), e))?;
        Ok(Buffer { memory, len, of: PhantomData, account: None })
    }

    /// Overwrites the first `data.len()` records.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the transfer fails.
    ///
    /// # Panics
    /// When `data` is longer than the buffer.
    pub fn write(&mut self, context: &Context, data: &[T]) -> Result<()> {
        assert!(data.len() <= self.len, "{} records into a buffer of {}", data.len(), self.len);
        if data.is_empty() {
            return Ok(());
        }
        let bytes: &[u8] = bytemuck::cast_slice(data);
        // SAFETY: blocking, so `bytes` outlives the transfer; the length was checked above.
        unsafe { context.queue.enqueue_write_buffer(&mut self.memory, CL_BLOCKING, 0, bytes, &[]) }
            .map(|_| ())
            .map_err(|e| failed("upload", e))
    }

    /// Fills `into` from the start of the buffer.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the transfer fails.
    ///
    /// # Panics
    /// When `into` is longer than the buffer.
    pub fn read(&self, context: &Context, into: &mut [T]) -> Result<()> {
        assert!(into.len() <= self.len, "{} records out of a buffer of {}", into.len(), self.len);
        if into.is_empty() {
            return Ok(());
        }
        self.read_bytes(context, bytemuck::cast_slice_mut(into))
    }

    /// Fills `bytes` from the start of the buffer.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the transfer fails.
    ///
    /// # Panics
    /// When `bytes` is longer than the buffer.
    pub fn read_bytes(&self, context: &Context, bytes: &mut [u8]) -> Result<()> {
        assert!(bytes.len() <= self.bytes(), "{} bytes out of a buffer of {}", bytes.len(), self.bytes());
        // SAFETY: blocking, so `bytes` is borrowed until the transfer is done; the length was checked above.
        unsafe { context.queue.enqueue_read_buffer(&self.memory, CL_BLOCKING, 0, bytes, &[]) }
            .map(|_| ())
            .map_err(|e| failed("readback", e))
    }

    /// Overwrites the first `count` records with those of another buffer, on the device. Returns at once; the queue is in
    /// order.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the transfer is refused.
    ///
    /// # Panics
    /// When either buffer is shorter.
    pub fn copy_from(&mut self, context: &Context, from: &Buffer<T>, count: usize) -> Result<()> {
        assert!(count <= self.len.min(from.len), "{count} records from {} into {}", from.len, self.len);
        if count == 0 {
            return Ok(());
        }
        let bytes = count * size_of::<T>();
        // SAFETY: OpenCL keeps both buffers until the copy is done; lengths were checked above.
        unsafe { context.queue.enqueue_copy_buffer(&from.memory, &mut self.memory, 0, 0, bytes, &[]) }
            .map(|_| ())
            .map_err(|e| failed("copy", e))
    }

    /// Shows the first `count` records to `use_them` where they lie, without a copy where the device's memory is the
    /// host's.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the transfer fails, and those of `use_them`.
    ///
    /// # Panics
    /// When the buffer is shorter.
    pub fn mapped<R>(&self, context: &Context, count: usize, use_them: impl FnOnce(&[T]) -> Result<R>) -> Result<R> {
        assert!(count <= self.len, "{count} records of a buffer of {}", self.len);
        if count == 0 {
            return use_them(&[]);
        }
        let mut address: cl_mem = ptr::null_mut();
        let bytes = count * size_of::<T>();
        // SAFETY: blocking, so the records are there when the call returns; the length was checked above.
        unsafe {
            context.queue.enqueue_map_buffer(&self.memory, CL_BLOCKING, CL_MAP_READ, 0, bytes, &mut address, &[])
        }
        .map_err(|e| failed("mapping", e))?;
        // SAFETY: the mapping holds `count` records of any bits until it is undone, and nothing writes meanwhile: the
        // queue is in order and waited for.
        let result = use_them(unsafe { std::slice::from_raw_parts(address.cast::<T>(), count) });
        // SAFETY: mapped above, and the slice is gone.
        let unmapped = unsafe { context.queue.enqueue_unmap_mem_object(self.memory.get(), address, &[]) };
        unmapped.map_err(|e| failed("unmapping", e))?;
        result
    }

    /// The record at `index`.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the transfer fails.
    ///
    /// # Panics
    /// When `index` is past the end.
    pub fn get(&self, context: &Context, index: usize) -> Result<T> {
        assert!(index < self.len, "record {index} of a buffer of {}", self.len);
        let mut record = [T::zeroed()];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut record);
        // SAFETY: blocking, so `bytes` is borrowed until the transfer is done; the index was checked above.
        unsafe { context.queue.enqueue_read_buffer(&self.memory, CL_BLOCKING, index * size_of::<T>(), bytes, &[]) }
            .map_err(|e| failed("readback", e))?;
        Ok(record[0])
    }

    /// All records.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the transfer fails.
    pub fn to_vec(&self, context: &Context) -> Result<Vec<T>> {
        let mut data = vec![T::zeroed(); self.len];
        self.read(context, &mut data)?;
        Ok(data)
    }

    /// Records, as asked for when made.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether no records were asked for.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> usize {
        self.len.max(1) * size_of::<T>()
    }

    pub(super) fn handle(&self) -> cl_mem {
        self.memory.get()
    }
}
